# SPDX-License-Identifier: Apache-2.0
"""What a picture must hold, reckoned from the stage alone: numpy in f64, no acceleration structure, no triangulation.

Walks the composed stage as USD defines it (transforms, visibility, purposes, point and native instances), makes the ray
of each pixel centre from the camera's attributes, and meets every polygon by its plane and an even-odd test. Shares
nothing with the product but the scene file. Rows are bottom-up, as in Hydra's buffers.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from pxr import Gf, Usd, UsdGeom

PROBE_PX = 2e-3
"""A pixel is unclear if rays this far beside its centre see another polygon."""


@dataclasses.dataclass
class Item:
    """A placed mesh: world points, polygons as corner index lists with their authored numbers."""

    path: str
    levels: tuple
    points: np.ndarray
    faces: list
    left_handed: bool = False


@dataclasses.dataclass
class Rays:
    """Pixel rays; distances along them are camera depths."""

    origins: np.ndarray
    directions: np.ndarray
    width: int
    height: int
    camera: Gf.Camera


@dataclasses.dataclass
class FirstHits:
    """Per pixel, (height, width): item number (-1 = none), face, camera depth, window depth, unclear mask."""

    items: list
    item: np.ndarray
    face: np.ndarray
    camera_depth: np.ndarray
    depth: np.ndarray
    normal: np.ndarray
    unclear: np.ndarray


def _matrix(matrix: Gf.Matrix4d) -> np.ndarray:
    """Row-vector matrix as numpy has it: p' = p @ m."""
    return np.array(matrix, dtype=np.float64)


def _apply(matrix: Gf.Matrix4d, points: np.ndarray) -> np.ndarray:
    m = _matrix(matrix)
    return points @ m[:3, :3] + m[3, :3]


def _mesh(prim: Usd.Prim, to_world: Gf.Matrix4d, levels: tuple) -> Item:
    mesh = UsdGeom.Mesh(prim)
    points = np.array(mesh.GetPointsAttr().Get(), dtype=np.float64)
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get())
    indices = np.array(mesh.GetFaceVertexIndicesAttr().Get())
    holes = set(mesh.GetHoleIndicesAttr().Get() or [])
    ends = np.cumsum(counts)
    faces = [
        (number, indices[end - count : end])
        for number, (count, end) in enumerate(zip(counts, ends))
        if number not in holes
    ]
    left = mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded
    mirrored = to_world.GetDeterminant3() < 0
    return Item(str(prim.GetPath()), levels, _apply(to_world, points), faces, left != mirrored)


def _shown(prim: Usd.Prim, purposes) -> bool:
    image = UsdGeom.Imageable(prim)
    return image.ComputeVisibility() != UsdGeom.Tokens.invisible and image.ComputePurpose() in purposes


def flatten(stage: Usd.Stage, purposes=("default", "proxy")) -> list[Item]:
    """Every placement of every mesh."""
    items: list[Item] = []
    _walk(stage.GetPseudoRoot(), Gf.Matrix4d(1), Gf.Matrix4d(1), (), purposes, items)
    return items


def _walk(
    root: Usd.Prim, root_to_world: Gf.Matrix4d, placed: Gf.Matrix4d, levels: tuple, purposes, items: list
) -> None:
    """Meshes below `root`; `placed` replaces the world transform `root_to_world` that the stage gives to the root's
    parent."""
    prims = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies()))
    for prim in prims:
        if prim.IsA(UsdGeom.PointInstancer) or prim.IsA(UsdGeom.Mesh):
            cache = UsdGeom.XformCache()
            local = cache.GetLocalToWorldTransform(prim)
            to_world = local * root_to_world.GetInverse() * placed
            if prim.IsA(UsdGeom.Mesh):
                if _shown(prim, purposes):
                    items.append(_mesh(prim, to_world, levels))
                continue
            prims.PruneChildren()
            if _shown(prim, purposes):
                _instances(prim, to_world, levels, purposes, items)


def _instances(prim: Usd.Prim, to_world: Gf.Matrix4d, levels: tuple, purposes, items: list) -> None:
    instancer = UsdGeom.PointInstancer(prim)
    kinds = instancer.GetProtoIndicesAttr().Get()
    mask = instancer.ComputeMaskAtTime(0) or [True] * len(kinds)
    placed = instancer.ComputeInstanceTransformsAtTime(
        0, 0, UsdGeom.PointInstancer.ExcludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
    )
    targets = instancer.GetPrototypesRel().GetTargets()
    stage = prim.GetStage()
    cache = UsdGeom.XformCache()
    for number, (kind, matrix) in enumerate(zip(kinds, placed)):
        if mask[number]:
            prototype = stage.GetPrimAtPath(targets[kind])
            parent = cache.GetLocalToWorldTransform(prototype.GetParent())
            _walk(prototype, parent, matrix * to_world, (*levels, (str(prim.GetPath()), number)), purposes, items)


def pixel_rays(
    stage: Usd.Stage, path: str, width: int, height: int, policy: str = "matchVertically", shift=(0.0, 0.0)
) -> Rays:
    """Rays through the pixel centres (moved by `shift` pixels), with the window conformed as CameraUtil defines."""
    camera = UsdGeom.Camera(stage.GetPrimAtPath(path)).GetCamera(Usd.TimeCode.Default())
    window = camera.frustum.window
    (left, bottom), (right, top) = window.min, window.max
    half_x, half_y, middle_x, middle_y = (right - left) / 2, (top - bottom) / 2, (left + right) / 2, (bottom + top) / 2
    aspect = width / height
    wider = half_x / half_y > aspect
    if policy == "matchHorizontally" or (policy == "fit" and wider) or (policy == "crop" and not wider):
        half_y = half_x / aspect
    elif policy in ("matchVertically", "fit", "crop"):
        half_x = half_y * aspect
    elif policy != "dontConform":
        raise ValueError(policy)
    x = (np.arange(width) + 0.5 + shift[0]) / width * 2 - 1
    y = (np.arange(height) + 0.5 + shift[1]) / height * 2 - 1
    x, y = np.meshgrid(middle_x + half_x * x, middle_y + half_y * y)
    flat = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    forward = np.array([0.0, 0.0, -1.0])
    if camera.projection == Gf.Camera.Perspective:
        origins, directions = np.zeros_like(flat), flat + forward
    else:
        origins, directions = flat, np.broadcast_to(forward, flat.shape)
    matrix = _matrix(camera.transform)
    return Rays(origins @ matrix[:3, :3] + matrix[3, :3], directions @ matrix[:3, :3], width, height, camera)


def _window_depth(camera: Gf.Camera, distance: np.ndarray) -> np.ndarray:
    near, far = camera.clippingRange.min, camera.clippingRange.max
    if camera.projection == Gf.Camera.Perspective:
        return 0.5 + 0.5 * ((far + near) - 2 * far * near / distance) / (far - near)
    return (distance - near) / (far - near)


def _meet(rays: Rays, points: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distances (faces, rays), infinite where missed, and normals (faces, 3) of polygons with equal corner counts."""
    corners = points[faces]
    after = np.roll(corners, -1, axis=1)
    normal = np.cross(corners - corners[:, :1], after - corners[:, :1]).sum(axis=1)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = normal / np.where(length > 0, length, 1)
    slope = normal @ rays.directions.T
    reach = np.einsum("fk,fk->f", normal, corners.mean(axis=1))[:, None] - normal @ rays.origins.T
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.where((slope != 0) & (length > 0), reach / slope, np.inf)
    distance = np.where(distance > 0, distance, np.inf)
    inside = np.zeros(distance.shape, dtype=bool)
    # Drop the axis along which the polygon is flattest, per face.
    axes = np.argsort(np.abs(normal), axis=1)[:, :2]
    for number in range(len(faces)):
        candidates = np.flatnonzero(np.isfinite(distance[number]))
        place = rays.origins[candidates] + rays.directions[candidates] * distance[number, candidates, None]
        u, v = place[:, axes[number, 0]], place[:, axes[number, 1]]
        polygon = corners[number][:, axes[number]]
        crossings = np.zeros(len(candidates), dtype=bool)
        for (au, av), (bu, bv) in zip(polygon, np.roll(polygon, -1, axis=0)):
            if av != bv:
                crossings ^= ((av > v) != (bv > v)) & (u < (bu - au) * (v - av) / (bv - av) + au)
        inside[number, candidates] = crossings
    return np.where(inside, distance, np.inf), normal


def _nearest(items: list[Item], rays: Rays):
    count = rays.width * rays.height
    best, second = np.full(count, np.inf), np.full(count, np.inf)
    item_of, face_of, normal_of = np.full(count, -1), np.full(count, -1), np.zeros((count, 3))
    for number, item in enumerate(items):
        for corners in sorted({len(face) for _, face in item.faces}):
            chosen = [(authored, face) for authored, face in item.faces if len(face) == corners]
            distance, normal = _meet(rays, item.points, np.array([face for _, face in chosen]))
            normal = -normal if item.left_handed else normal
            for row, (authored, _) in enumerate(chosen):
                closer = distance[row] < best
                second = np.where(closer, best, np.minimum(second, distance[row]))
                best = np.where(closer, distance[row], best)
                item_of, face_of = np.where(closer, number, item_of), np.where(closer, authored, face_of)
                normal_of[closer] = normal[row]
    return best, second, item_of, face_of, normal_of


def first_hits(
    stage: Usd.Stage, camera: str, width: int, height: int, policy="matchVertically", purposes=("default", "proxy")
) -> FirstHits:
    """The nearest polygon of each pixel centre."""
    items = flatten(stage, purposes)
    rays = pixel_rays(stage, camera, width, height, policy)
    best, second, item, face, normal = _nearest(items, rays)
    unclear = (item >= 0) & (second <= (1 + 1e-5) * best)
    for shift in ((PROBE_PX, 0), (-PROBE_PX, 0), (0, PROBE_PX), (0, -PROBE_PX)):
        _, _, item2, face2, _ = _nearest(items, pixel_rays(stage, camera, width, height, policy, shift))
        unclear |= (item2 != item) | (face2 != face)
    shape = (height, width)
    with np.errstate(invalid="ignore"):
        depth = np.where(item >= 0, _window_depth(rays.camera, best), 1.0)
    best = np.where(item >= 0, best, 0.0)
    return FirstHits(
        items, item.reshape(shape), face.reshape(shape), best.reshape(shape), depth.reshape(shape),
        normal.reshape(*shape, 3), unclear.reshape(shape),
    )
