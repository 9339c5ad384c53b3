# SPDX-License-Identifier: Apache-2.0
"""Smooth meshes with normals and texture coordinates: solids of revolution, cards, boxes, height fields. Needs numpy
and any pxr."""

from __future__ import annotations

import math

import numpy as np
from pxr import Gf, Sdf, UsdGeom, Vt

CREASE = math.cos(math.radians(35))
"""Edges of a profile that bend more than this stay sharp."""


def raw_mesh(stage, path, points, counts, indices, normals=None, st=None, color=None):
    """A mesh from arrays; normals and st are face-varying."""
    prim = UsdGeom.Mesh.Define(stage, path)
    prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points, dtype=np.float32)))
    prim.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(counts, dtype=np.int32)))
    prim.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(indices, dtype=np.int32)))
    if normals is not None:
        prim.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(normals, dtype=np.float32)))
        prim.SetNormalsInterpolation(UsdGeom.Tokens.faceVarying)
    if st is not None:
        primvar = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(
            "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
        )
        primvar.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(st, dtype=np.float32)))
    if color is not None:
        prim.CreateDisplayColorPrimvar(UsdGeom.Tokens.constant).Set(Vt.Vec3fArray([Gf.Vec3f(*color)]))
    points = np.asarray(points)
    prim.CreateExtentAttr(
        Vt.Vec3fArray([Gf.Vec3f(*map(float, points.min(axis=0))), Gf.Vec3f(*map(float, points.max(axis=0)))])
    )
    return prim


def _profile_normals(profile: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Normals (r, y) at the lower and the upper end of each segment."""
    step = np.diff(profile, axis=0)
    flat = np.stack([step[:, 1], -step[:, 0]], axis=1)
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    low, high = flat.copy(), flat.copy()
    for k in range(len(flat) - 1):
        if flat[k] @ flat[k + 1] > CREASE:
            middle = flat[k] + flat[k + 1]
            low[k + 1] = high[k] = middle / np.linalg.norm(middle)
    return low, high


def lathe(stage, path, profile, sides=48, color=None, tiles=(1.0, 1.0)):
    """The profile, (radius, height) from the bottom up with the outside on its right, turned about y. st runs to
    `tiles`."""
    profile = np.asarray(profile, dtype=np.float64)
    low, high = _profile_normals(profile)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(profile, axis=0), axis=1))])
    v = length / length[-1] * tiles[1]
    angle = 2 * math.pi * np.arange(sides + 1) / sides
    ring = np.stack([np.sin(angle), np.zeros(sides + 1), np.cos(angle)], axis=1)
    starts, points = [], []
    for radius, height in profile:
        starts.append(len(points))
        rows = [(0.0, height, 0.0)] if radius == 0 else [(radius * x, height, radius * z) for x, _, z in ring[:-1]]
        points.extend(rows)
    at = lambda k, side: starts[k] if profile[k, 0] == 0 else starts[k] + side % sides
    counts, indices, normals, st = [], [], [], []
    for k in range(len(profile) - 1):
        for side in range(sides):
            corners = [(k, side, low[k]), (k, side + 1, low[k]), (k + 1, side + 1, high[k]), (k + 1, side, high[k])]
            # At a pole two corners are one point; its corner takes the middle of the side.
            if profile[k, 0] == 0:
                corners = corners[1:]
            elif profile[k + 1, 0] == 0:
                corners = corners[:3]
            counts.append(len(corners))
            for row, column, normal in corners:
                indices.append(at(row, column))
                pole = profile[row, 0] == 0
                turn = 2 * math.pi * ((side + 0.5) if pole else column) / sides
                normals.append((normal[0] * math.sin(turn), normal[1], normal[0] * math.cos(turn)))
                st.append((((side + 0.5) if pole else column) / sides * tiles[0], v[row]))
    return raw_mesh(stage, path, points, counts, indices, normals, st, color)


def sphere(stage, path, radius=1.0, rings=24, color=None, tiles=(1.0, 1.0)):
    """A smooth sphere about the origin; st is longitude and latitude."""
    polar = np.linspace(-math.pi / 2, math.pi / 2, rings + 1)
    profile = np.stack([radius * np.cos(polar), radius * np.sin(polar)], axis=1)
    profile[0, 0] = profile[-1, 0] = 0.0
    return lathe(stage, path, profile, 2 * rings, color, tiles)


def ground(stage, path, size, tiles=1.0, color=None):
    """A square in the plane y = 0, facing up, with st to `tiles`."""
    h = size / 2
    points = [(-h, 0, h), (h, 0, h), (h, 0, -h), (-h, 0, -h)]
    return raw_mesh(
        stage, path, points, [4], [0, 1, 2, 3], [(0, 1, 0)] * 4, [(0, 0), (tiles, 0), (tiles, tiles), (0, tiles)], color
    )


def card(stage, path, width=1.0, height=1.0, columns=1, rows=1, bend=0.0, color=None):
    """A sheet in the xy plane from (-width/2, 0) to (width/2, height), facing +z, st 0 .. 1; `bend` is how far its top
    leans to +z."""
    u, v = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
    points = np.stack([width * (u - 0.5), height * v, bend * v**2 + 0.3 * bend * (2 * u - 1) ** 2], axis=-1).reshape(
        -1, 3
    )
    slope_y, slope_x = np.full_like(v, height), 1.2 * bend * (2 * u - 1) / max(width, 1e-9)
    normal = np.stack([-slope_x, -2 * bend * v / slope_y, np.ones_like(v)], axis=-1).reshape(-1, 3)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    st = np.stack([u, v], axis=-1).reshape(-1, 2)
    cells = np.array([
        (j * (columns + 1) + i + a)
        for j in range(rows)
        for i in range(columns)
        for a in (0, 1, columns + 2, columns + 1)
    ])
    return raw_mesh(stage, path, points, [4] * (columns * rows), cells, normal[cells], st[cells], color)


def block(stage, path, size=(1, 1, 1), color=None, tiles=1.0):
    """A box about the origin; every side has st 0 .. `tiles`."""
    half = np.asarray(size, dtype=np.float64) / 2
    sides = [
        ((0, 0, 1), (1, 0, 0)), ((0, 0, -1), (-1, 0, 0)), ((1, 0, 0), (0, 0, -1)), ((-1, 0, 0), (0, 0, 1)),
        ((0, 1, 0), (1, 0, 0)), ((0, -1, 0), (1, 0, 0)),
    ]
    points, normals, st = [], [], []
    for normal, right in sides:
        up = np.cross(normal, right)
        for s, t in ((0, 0), (1, 0), (1, 1), (0, 1)):
            points.append((np.array(normal) + (2 * s - 1) * np.array(right) + (2 * t - 1) * up) * half)
            normals.append(normal)
            st.append((s * tiles, t * tiles))
    return raw_mesh(stage, path, points, [4] * 6, range(24), normals, st, color)


def put(prim, position=(0, 0, 0), turn=0.0, tilt=0.0, scale=1.0):
    """Scales, tilts about x, turns about y (degrees), then moves; returns the prim."""
    prim.AddTranslateOp().Set(Gf.Vec3d(*map(float, position)))
    if turn:
        prim.AddRotateYOp().Set(float(turn))
    if tilt:
        prim.AddRotateXOp().Set(float(tilt))
    if scale != 1.0:
        prim.AddScaleOp().Set(Gf.Vec3f(scale) if not isinstance(scale, (tuple, list)) else Gf.Vec3f(*scale))
    return prim
