# SPDX-License-Identifier: Apache-2.0
"""A USD stage as plain arrays: what a reference renderer needs, with every instance multiplied out. Needs usd-core and
numpy.

Walks the composed stage as USD defines it: transforms, visibility, purposes `default`, `proxy` and `render`, point and
native instances, GeomSubsets, inherited bindings (usd-core resolves them). Shares no code with the product. What it
does not know it puts into `notes`.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdLux, UsdShade

LIGHTS = (
    UsdLux.DistantLight, UsdLux.DomeLight, UsdLux.DomeLight_1, UsdLux.RectLight, UsdLux.SphereLight, UsdLux.DiskLight,
    UsdLux.CylinderLight,
)


@dataclasses.dataclass
class Part:
    """Triangles of one material in world space; one vertex per corner."""

    path: str
    points: np.ndarray
    normals: np.ndarray | None
    st: np.ndarray | None
    colors: np.ndarray | None
    opacity: float
    material: UsdShade.Material | None
    left_handed: bool = False


@dataclasses.dataclass
class Lamp:
    """A light prim and where it is, as a column-vector matrix."""

    prim: Usd.Prim
    to_world: np.ndarray


@dataclasses.dataclass
class Scene:
    stage: Usd.Stage
    parts: list[Part] = dataclasses.field(default_factory=list)
    lamps: list[Lamp] = dataclasses.field(default_factory=list)
    notes: list[str] = dataclasses.field(default_factory=list)


def columns(matrix: Gf.Matrix4d) -> np.ndarray:
    """USD multiplies rows from the left; everyone else columns from the right."""
    return np.array(matrix, dtype=np.float64).T


def _expanded(values, interpolation, corner_points, corner_faces) -> np.ndarray:
    """One value per triangle corner."""
    values = np.asarray(values, dtype=np.float64)
    if values.ndim == 1:
        values = values[:, None]
    if interpolation == UsdGeom.Tokens.constant:
        return np.broadcast_to(values[0], (len(corner_points), values.shape[1]))
    if interpolation == UsdGeom.Tokens.uniform:
        return values[corner_faces]
    if interpolation == UsdGeom.Tokens.faceVarying:
        return values
    return values[corner_points]


class _Reader:
    """Meshes of a stage, each read once however often it is placed."""

    def __init__(self, scene: Scene) -> None:
        self._scene, self._meshes = scene, {}

    def parts(self, prim: Usd.Prim) -> list[Part]:
        path = str(prim.GetPath())
        if path not in self._meshes:
            self._meshes[path] = self._read(prim)
        return self._meshes[path]

    def _read(self, prim: Usd.Prim) -> list[Part]:
        mesh = UsdGeom.Mesh(prim)
        points = np.array(mesh.GetPointsAttr().Get(), dtype=np.float64)
        counts = np.array(mesh.GetFaceVertexCountsAttr().Get())
        indices = np.array(mesh.GetFaceVertexIndicesAttr().Get())
        if mesh.GetSubdivisionSchemeAttr().Get() != UsdGeom.Tokens.none:
            self._scene.notes.append(f"{prim.GetPath()}: a subdivision surface, taken as its cage")
        starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
        # Fans: right for convex faces, which is all the scenes have.
        corners, faces = [], []
        for size in sorted(set(counts.tolist())):
            chosen = np.flatnonzero(counts == size)
            for k in range(1, size - 1):
                corners.append(starts[chosen, None] + [0, k, k + 1])
                faces.append(chosen)
        corners, faces = np.concatenate(corners), np.concatenate(faces)
        flat = corners.ravel()
        corner_points, corner_faces = indices[flat], np.repeat(faces, 3)

        def primvar(name):
            made = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
            if not made or not made.HasValue():
                return None
            values = np.array(made.ComputeFlattened())
            interpolation = made.GetInterpolation()
            if interpolation == UsdGeom.Tokens.faceVarying:
                values = values[flat]
            return _expanded(values, interpolation, corner_points, corner_faces)

        normals = primvar("normals")
        if normals is None and mesh.GetNormalsAttr().HasAuthoredValue():
            values = np.array(mesh.GetNormalsAttr().Get(), dtype=np.float64)
            interpolation = mesh.GetNormalsInterpolation()
            normals = _expanded(
                values[flat] if interpolation == UsdGeom.Tokens.faceVarying else values, interpolation, corner_points,
                corner_faces,
            )
        st, colors, opacity = primvar("st"), primvar("displayColor"), primvar("displayOpacity")
        left = mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded
        whole = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0] or None
        groups, rest = [], np.ones(len(counts), dtype=bool)
        for subset in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets():
            mask = np.zeros(len(counts), dtype=bool)
            mask[np.array(subset.GetIndicesAttr().Get())] = True
            groups.append(
                (mask & rest, UsdShade.MaterialBindingAPI(subset.GetPrim()).ComputeBoundMaterial()[0] or None)
            )
            rest &= ~mask
        parts = []
        for mask, material in [*groups, (rest, whole)]:
            chosen = mask[corner_faces]
            if chosen.any():
                take = lambda values: None if values is None else values[chosen]
                parts.append(
                    Part(
                        str(prim.GetPath()), points[corner_points][chosen], take(normals), take(st), take(colors),
                        1.0 if opacity is None else float(opacity.mean()), material, left,
                    )
                )
        return parts


def _placed(part: Part, matrix: np.ndarray, color=None) -> Part:
    linear = matrix[:3, :3]
    points = part.points @ linear.T + matrix[:3, 3]
    left = part.left_handed != (np.linalg.det(linear) < 0)
    normals = part.normals
    if normals is not None:
        normals = normals @ np.linalg.inv(linear)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        normals = normals / np.where(length > 0, length, 1)
    st, colors = part.st, part.colors if color is None else np.broadcast_to(color, part.points.shape)
    if left:
        turn = lambda values: (
            None if values is None else values.reshape(-1, 3, values.shape[-1])[:, [0, 2, 1]].reshape(values.shape)
        )
        points, normals, st, colors = (
            turn(points), turn(normals), turn(st), turn(np.array(colors)) if colors is not None else None
        )
    return dataclasses.replace(part, points=points, normals=normals, st=st, colors=colors, left_handed=False)


def read(stage: Usd.Stage) -> Scene:
    """All placed meshes and lights."""
    scene = Scene(stage)
    _walk(scene, _Reader(scene), stage.GetPseudoRoot(), np.eye(4), None)
    return scene


def _walk(scene: Scene, reader: _Reader, root: Usd.Prim, placed: np.ndarray, color) -> None:
    """What is below `root`; `placed` comes in front of the prims' world transforms."""
    prims = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies()))
    for prim in prims:
        image = UsdGeom.Imageable(prim)
        if image and (
            image.ComputeVisibility() == UsdGeom.Tokens.invisible or image.ComputePurpose() == UsdGeom.Tokens.guide
        ):
            prims.PruneChildren()
            continue
        if not prim.IsA(UsdGeom.Xformable):
            continue
        to_world = placed @ columns(UsdGeom.XformCache().GetLocalToWorldTransform(prim))
        if prim.IsA(UsdGeom.PointInstancer):
            prims.PruneChildren()
            _instances(scene, reader, prim, to_world)
        elif prim.IsA(UsdGeom.Mesh):
            scene.parts.extend(_placed(part, to_world, color) for part in reader.parts(prim))
        elif any(prim.IsA(kind) for kind in LIGHTS):
            scene.lamps.append(Lamp(prim, to_world))
        elif prim.IsA(UsdGeom.Gprim):
            scene.notes.append(f"{prim.GetPath()}: {prim.GetTypeName()} left out")


def _instances(scene: Scene, reader: _Reader, prim: Usd.Prim, to_world: np.ndarray) -> None:
    instancer = UsdGeom.PointInstancer(prim)
    kinds = instancer.GetProtoIndicesAttr().Get()
    mask = instancer.ComputeMaskAtTime(0) or [True] * len(kinds)
    matrices = instancer.ComputeInstanceTransformsAtTime(
        0, 0, UsdGeom.PointInstancer.ExcludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
    )
    targets = [prim.GetStage().GetPrimAtPath(path) for path in instancer.GetPrototypesRel().GetTargets()]
    above = [
        np.linalg.inv(columns(UsdGeom.XformCache().GetLocalToWorldTransform(target.GetParent()))) for target in targets
    ]
    primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar("displayColor")
    colors = (
        np.array(primvar.ComputeFlattened())
        if primvar and primvar.HasValue() and primvar.GetInterpolation() != UsdGeom.Tokens.constant
        else None
    )
    for number, (kind, matrix) in enumerate(zip(kinds, matrices)):
        if mask[number]:
            _walk(
                scene, reader, targets[kind], to_world @ columns(matrix) @ above[kind],
                None if colors is None else colors[number],
            )


def merged(parts: list[Part]) -> list[Part]:
    """Parts of one mesh and material in one; a thousand leaves become four shapes."""
    groups: dict = {}
    for part in parts:
        constant = part.colors is None or (part.colors == part.colors[0]).all()
        color = None if part.colors is None else (tuple(part.colors[0]) if constant else "varying")
        key = (part.path, str(part.material.GetPath()) if part.material else "", color, part.opacity)
        groups.setdefault(key, []).append(part)
    together = lambda group, name: (
        None if getattr(group[0], name) is None else np.concatenate([getattr(part, name) for part in group])
    )
    return [
        dataclasses.replace(
            group[0], points=together(group, "points"), normals=together(group, "normals"), st=together(group, "st"),
            colors=together(group, "colors"),
        )
        for group in groups.values()
    ]
