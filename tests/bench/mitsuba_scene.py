#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A USD file written as a scene for Mitsuba 3, by a Python that has pxr and numpy; Mitsuba is not needed here.

    mitsuba_scene.py JOB.json

The folder gets `scene.json`, Mitsuba's dictionary in JSON, with meshes as PLY, curves as text, points and places of
instances as arrays of numpy. What Mitsuba's own types are made of is told as plain data, for `mitsuba_process.py`:
`{"matrix": rows}` a transform, `{"picture": ...}` the files of a bitmap and what is done with their values,
`"places": FILE` the instances of a shape group, `"points": FILE` the balls of `ellipsoids`.

- A mesh (curves, points) that stands in one place is a shape of the world. One of many places is a shape group with an
  instance for each place: nested instances and point instancers are multiplied out to that one level.
- Subdivision surfaces and displacement: see `subdivide.py`. Everything is as it stands at one time.
- UsdPreviewSurface and standard_surface are `principled`; clear ones `dielectric`; opacity with a threshold, or from a
  picture, is a `mask`.
- Lights of forms are shapes with an `area` emitter; disks and spheres with a narrow cone are a `spot` of no size.
- A scene above `triangles` or `instances` is refused.

What was left out is told by reason, with how often and where first.
"""

from __future__ import annotations

import json
import math
import pathlib
import sys
import time as clock

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdLux, UsdShade

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import mitsuba_materials  # noqa: E402
from mitsuba_materials import Notes, rgb  # noqa: E402

FAR = 1e4
"""Distance of a distant light's disk, in radii of the scene."""
ROULETTE = 5
"""Mitsuba's own: from this depth on paths end at random."""
LIGHTS = (
    UsdLux.DistantLight, UsdLux.DomeLight, UsdLux.DomeLight_1, UsdLux.RectLight, UsdLux.SphereLight, UsdLux.DiskLight,
    UsdLux.CylinderLight,
)  # fmt: skip
BEZIER = np.array([[-1, 3, -3, 1], [3, -6, 3, 0], [-3, 3, 0, 0], [1, 0, 0, 0]], float)
CATMULL_ROM = np.array([[-1, 3, -3, 1], [2, -5, 4, -1], [-1, 0, 1, 0], [0, 2, 0, 0]]) / 2
BSPLINE = np.array([[-1, 3, -3, 1], [3, -6, 3, 0], [-3, 0, 3, 0], [1, 4, 1, 0]]) / 6


class TooLarge(ValueError):
    """The scene is above a limit."""


def columns(matrix: Gf.Matrix4d) -> np.ndarray:
    """USD multiplies rows from the left; everyone else columns from the right."""
    return np.array(matrix, np.float64).T


def matrix(values) -> dict:
    return {"matrix": np.asarray(values, float).tolist()}


def is_shown(prim: Usd.Prim, time) -> bool:
    """What usdrecord draws of itself: the purposes default and proxy."""
    image = UsdGeom.Imageable(prim)
    if not image:
        return True
    if image.GetVisibilityAttr().Get(time) == UsdGeom.Tokens.invisible:
        return False
    return image.ComputePurpose() in (UsdGeom.Tokens.default_, UsdGeom.Tokens.proxy)


class Places:
    """Where everything stands: for each leaf of the stage its matrices, (n, 4, 4)."""

    def __init__(self, time, most: int, notes: Notes) -> None:
        self._time, self._most, self._notes = time, most, notes
        self._known: dict = {}

    def below(self, prim: Usd.Prim) -> dict[str, tuple[Usd.Prim, np.ndarray]]:
        """Leaves of a prim, in the space of its parent."""
        if not is_shown(prim, self._time):
            return {}
        key = str(prim.GetPath())
        if prim.IsInstance():
            # What is bound above an instance holds within it.
            bound = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
            key = (str(prim.GetPrototype().GetPath()), str(bound.GetPath()) if bound else "")
        if key not in self._known:
            self._known[key] = self._inside(prim)
        local = np.eye(4)
        if prim.IsA(UsdGeom.Xformable):
            able = UsdGeom.Xformable(prim)
            local = columns(able.GetLocalTransformation(self._time))
            if able.GetResetXformStack():
                self._notes.add("a transform that begins anew, taken as one that goes on", prim)
        return {path: (leaf, local @ places) for path, (leaf, places) in self._known[key].items()}

    def _inside(self, prim: Usd.Prim) -> dict:
        if prim.IsA(UsdGeom.PointInstancer):
            return self._instancer(UsdGeom.PointInstancer(prim))
        is_leaf = prim.IsA(UsdGeom.Gprim) or any(prim.IsA(kind) for kind in LIGHTS)
        found: dict = {str(prim.GetPath()): (prim, [np.eye(4)[None]])} if is_leaf else {}
        for child in prim.GetFilteredChildren(Usd.TraverseInstanceProxies()):
            if not child.IsA(UsdGeom.Subset):
                self._add(found, self.below(child))
        return self._whole(found)

    def _instancer(self, instancer: UsdGeom.PointInstancer) -> dict:
        kinds = np.array(instancer.GetProtoIndicesAttr().Get(self._time) or [], int)
        targets = instancer.GetPrototypesRel().GetForwardedTargets()
        if not len(kinds):
            return {}
        made = instancer.ComputeInstanceTransformsAtTime(
            self._time, self._time, UsdGeom.PointInstancer.ExcludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
        )
        places = np.array(made, np.float64).transpose(0, 2, 1)
        if len(places) != len(kinds):
            self._notes.add("an instancer whose arrays differ in length", instancer.GetPrim())
            return {}
        mask = instancer.ComputeMaskAtTime(self._time)
        used = np.array(mask, bool) if mask else np.ones(len(kinds), bool)
        found: dict = {}
        for kind, path in enumerate(targets):
            own = places[used & (kinds == kind)]
            prototype = instancer.GetPrim().GetStage().GetPrimAtPath(path)
            if len(own) and prototype:
                below = self.below(prototype)
                count = len(own) * sum(len(inside) for _, inside in below.values())
                self._expect(count)
                self._add(found, {
                    leaf_path: (leaf, (own[:, None] @ inside[None]).reshape(-1, 4, 4))
                    for leaf_path, (leaf, inside) in below.items()
                })  # fmt: skip
        return self._whole(found)

    def _add(self, found: dict, more: dict) -> None:
        for path, (leaf, places) in more.items():
            found.setdefault(path, (leaf, []))[1].append(places)

    def _whole(self, found: dict) -> dict:
        self._expect(sum(len(places) for _, parts in found.values() for places in parts))
        return {path: (leaf, np.concatenate(parts)) for path, (leaf, parts) in found.items()}

    def _expect(self, count: int) -> None:
        if count > self._most:
            raise TooLarge(f"{count} instances in one level, more than {self._most}")


def triangles(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners of fans, (n, 3) numbers into the face corners, and the face of each triangle."""
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    corners, faces = [np.zeros((0, 3), int)], [np.zeros(0, int)]
    for size in np.unique(counts):
        chosen = np.flatnonzero(counts == size)
        for k in range(1, size - 1):
            corners.append(starts[chosen, None] + [0, k, k + 1])
            faces.append(chosen)
    return np.concatenate(corners), np.concatenate(faces)


def smooth_normals(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Of points, from the areas of the triangles about them."""
    a, b, c = (points[faces[:, corner]] for corner in range(3))
    facing = np.cross(b - a, c - a)
    made = np.zeros_like(points)
    for corner in range(3):
        np.add.at(made, faces[:, corner], facing)
    return made / np.maximum(np.linalg.norm(made, axis=1, keepdims=True), 1e-30)


class Mesh:
    """Triangles of one material: points, normals or None, st or None, faces."""

    def __init__(self, points, normals, st, faces, material) -> None:
        self.points, self.normals, self.st, self.faces, self.material = points, normals, st, faces, material

    def backs(self) -> Mesh:
        """The other side, a little behind: Mitsuba's emitters shine from one."""
        normals = smooth_normals(self.points, self.faces)
        edges = self.points[self.faces[:, 1]] - self.points[self.faces[:, 0]]
        gap = 1e-3 * float(np.median(np.linalg.norm(edges, axis=1)))
        turned = None if self.normals is None else -self.normals
        return Mesh(self.points - gap * normals, turned, self.st, self.faces[:, ::-1], self.material)

    def moved(self, place: np.ndarray) -> Mesh:
        linear = place[:3, :3]
        is_turned = np.linalg.det(linear) < 0
        normals = None if self.normals is None else self.normals @ np.linalg.inv(linear)
        if normals is not None:
            normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
        faces = self.faces[:, ::-1] if is_turned else self.faces
        return Mesh(self.points @ linear.T + place[:3, 3], normals, self.st, faces, self.material)

    def write(self, path: pathlib.Path) -> None:
        """Binary PLY."""
        parts = [("xyz", self.points), (("nx", "ny", "nz"), self.normals), ("uv", self.st)]
        parts = [(names, values) for names, values in parts if values is not None]
        names = [name for group, _ in parts for name in group]
        table = np.concatenate([values for _, values in parts], 1).astype("<f4")
        listed = np.empty(len(self.faces), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
        listed["count"], listed["corners"] = 3, self.faces
        head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(table)}"]
        head += [f"property float {name}" for name in names]
        head += [f"element face {len(listed)}", "property list uchar int vertex_indices", "end_header"]
        with open(path, "wb") as file:
            file.write(("\n".join(head) + "\n").encode())
            file.write(table.tobytes())
            file.write(listed.tobytes())


def primvar(prim: Usd.Prim, name: str, time):
    """(values, interpolation) of a primvar, None where it has none."""
    found = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
    values = found.ComputeFlattened(time) if found and found.HasValue() else None
    return None if values is None else (np.array(values, np.float64), found.GetInterpolation())


def bound(prim: Usd.Prim) -> UsdShade.Material | None:
    return UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0] or None


def meshes(prim: Usd.Prim, time, notes: Notes) -> list[Mesh]:
    """Triangles of a mesh prim in its own space, apart by material."""
    mesh = UsdGeom.Mesh(prim)
    points = np.array(mesh.GetPointsAttr().Get(time) or [], np.float64).reshape(-1, 3)
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get(time) or [], int)
    indices = np.array(mesh.GetFaceVertexIndicesAttr().Get(time) or [], int)
    if not len(counts) or counts.sum() != len(indices) or indices.max() >= len(points):
        notes.add("a mesh without faces, or whose arrays differ in length", prim)
        return []
    corners, of_face = triangles(counts)
    if mesh.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded:
        corners = corners[:, ::-1]
    faces = indices[corners]
    values = {"points": (points, UsdGeom.Tokens.vertex), "st": primvar(prim, "st", time)}
    normals = primvar(prim, "normals", time)
    if mesh.GetSubdivisionSchemeAttr().Get(time) != UsdGeom.Tokens.none:
        notes.add("a subdivision surface, taken as its cage with smooth normals", prim)
        normals = (smooth_normals(points, faces), UsdGeom.Tokens.vertex)
    elif normals is None and mesh.GetNormalsAttr().HasAuthoredValue():
        normals = (np.array(mesh.GetNormalsAttr().Get(time), np.float64), mesh.GetNormalsInterpolation())
    values["normals"] = normals
    flat = corners.ravel()
    by_corner = {
        UsdGeom.Tokens.faceVarying: flat, UsdGeom.Tokens.uniform: np.repeat(of_face, 3),
        UsdGeom.Tokens.constant: np.zeros(len(flat), int),
    }  # fmt: skip
    is_indexed = all(one is None or one[1] not in by_corner for one in values.values())
    for name, one in values.items():
        if one is not None:
            pick = by_corner.get(one[1], faces.ravel())
            if len(one[0]) <= pick.max(initial=0):
                notes.add(f"{name} whose length is not that of its interpolation", prim)
                values[name] = None
            else:
                values[name] = one[0] if is_indexed else one[0][pick]
    if not is_indexed:
        faces = np.arange(len(flat)).reshape(-1, 3)
    if values["st"] is not None:
        values["st"] = values["st"][:, :2]
    made, rest = [], np.ones(len(counts), bool)
    for subset in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets():
        own = np.zeros(len(counts), bool)
        own[np.array(subset.GetIndicesAttr().Get(time) or [], int)] = True
        made.append(_part(values, faces, (own & rest)[of_face], bound(subset.GetPrim())))
        rest &= ~own
    made.append(_part(values, faces, rest[of_face], bound(prim)))
    return [one for one in made if len(one.faces)]


def _part(values: dict, faces: np.ndarray, chosen: np.ndarray, material) -> Mesh:
    if chosen.all():
        return Mesh(values["points"], values["normals"], values["st"], faces, material)
    used, packed = np.unique(faces[chosen], return_inverse=True)
    take = lambda name: None if values[name] is None else values[name][used]
    return Mesh(take("points"), take("normals"), take("st"), packed.reshape(-1, 3), material)


def strands(prim: Usd.Prim, time, notes: Notes) -> tuple[str, list[np.ndarray]]:
    """Mitsuba's type and for each curve its control points with radii, (n, 4)."""
    curves = UsdGeom.BasisCurves(prim)
    counts = np.array(curves.GetCurveVertexCountsAttr().Get(time) or [], int)
    points = np.array(curves.GetPointsAttr().Get(time) or [], np.float64).reshape(-1, 3)
    widths = np.array(curves.GetWidthsAttr().Get(time) or [1.0], np.float64)
    if counts.sum() != len(points) or not len(counts):
        notes.add("curves whose arrays differ in length", prim)
        return "linearcurve", []
    if len(widths) == len(counts) and len(widths) != len(points):
        widths = np.repeat(widths, counts)
    elif len(widths) != len(points):
        if len(widths) != 1:
            notes.add("widths of curves that are neither of curves nor of points, the first is taken", prim)
        widths = np.full(len(points), widths[0])
    wrap, is_cubic = curves.GetWrapAttr().Get(time), curves.GetTypeAttr().Get(time) == UsdGeom.Tokens.cubic
    if wrap == UsdGeom.Tokens.periodic:
        notes.add("periodic curves, taken as open ones", prim)
    both = np.concatenate([points, widths[:, None] / 2], 1)
    ends = np.cumsum(counts)
    basis, made = curves.GetBasisAttr().Get(time), []
    for start, end in zip(ends - counts, ends):
        strand = both[start:end]
        if is_cubic:
            made += cubic(strand, basis, wrap == UsdGeom.Tokens.pinned)
        elif len(strand) > 1:
            made.append(strand)
    for strand in made:
        strand[:, 3] = np.maximum(strand[:, 3], 1e-6)
    return "bsplinecurve" if is_cubic else "linearcurve", made


def cubic(strand: np.ndarray, basis: str, is_pinned: bool) -> list[np.ndarray]:
    """A cubic curve as uniform B-splines: one, or one for each of its pieces."""
    if basis == UsdGeom.Tokens.bezier:
        windows, own = [strand[at : at + 4] for at in range(0, len(strand) - 3, 3)], BEZIER
    else:
        if is_pinned and len(strand) > 1:
            strand = np.concatenate([2 * strand[:1] - strand[1:2], strand, 2 * strand[-1:] - strand[-2:-1]])
        if basis == UsdGeom.Tokens.bspline:
            return [strand.copy()] if len(strand) > 3 else []
        windows, own = [strand[at : at + 4] for at in range(len(strand) - 3)], CATMULL_ROM
    change = np.linalg.solve(BSPLINE, own)
    return [change @ window for window in windows]


def write_strands(path: pathlib.Path, made: list[np.ndarray]) -> None:
    with open(path, "w") as file:
        for strand in made:
            file.writelines("%.7g %.7g %.7g %.7g\n" % tuple(point) for point in strand)
            file.write("\n")


def balls(prim: Usd.Prim, time, notes: Notes) -> np.ndarray:
    """Points as (n, 4): places and radii."""
    points = np.array(UsdGeom.Points(prim).GetPointsAttr().Get(time) or [], np.float64).reshape(-1, 3)
    widths = np.array(UsdGeom.Points(prim).GetWidthsAttr().Get(time) or [1.0], np.float64)
    if len(widths) != len(points):
        widths = np.full(len(points), widths[0])
    return np.concatenate([points, widths[:, None] / 2], 1)


def get(prim: Usd.Prim, name: str, default, time):
    """An input of a light."""
    value = prim.GetAttribute(f"inputs:{name}").Get(time) if prim.HasAttribute(f"inputs:{name}") else None
    return default if value is None else value


def radiance(prim: Usd.Prim, time) -> np.ndarray:
    """intensity * 2^exposure * color * blackbody."""
    value = np.array(get(prim, "color", (1, 1, 1), time), np.float64) * get(prim, "intensity", 1.0, time)
    value = value * 2.0 ** get(prim, "exposure", 0.0, time)
    if get(prim, "enableColorTemperature", False, time):
        value = value * np.array(UsdLux.BlackbodyTemperatureAsRgb(get(prim, "colorTemperature", 6500.0, time)))
    return value


def lamp(prim: Usd.Prim, place: np.ndarray, time, ball: tuple, blocks: bool, notes: Notes) -> dict:
    """The emitter of a light; `ball` is middle and radius of the scene. Without `blocks` rays go through lights."""
    if any(get(prim, name, 1.0, time) != 1 for name in ("diffuse", "specular")):
        notes.add("multipliers of diffuse and specular light", prim)
    if not get(prim, "shadow:enable", True, time):
        notes.add("a light without shadows, taken as one with", prim)
    if prim.IsA(UsdLux.DomeLight) or prim.IsA(UsdLux.DomeLight_1):
        return dome(prim, place, time)
    if prim.IsA(UsdLux.DistantLight):
        return sun(prim, place, time, ball)
    value, kind, local, area = form(prim, place, time)
    if get(prim, "normalize", False, time):
        value = value / area
    if prim.HasAPI(UsdLux.ShapingAPI):
        if get(prim, "shaping:focus", 0.0, time) or get(prim, "shaping:ies:file", None, time):
            notes.add("focus or IES profile of a light", prim)
        angle = get(prim, "shaping:cone:angle", 90.0, time)
        if angle < 90:
            notes.add("a light with a cone, taken as a spot of no size", prim)
            return spot(prim, place, value * area, angle, kind, time)
    shine = rgb(value)
    file = prim.GetAttribute("inputs:texture:file").Get(time) if prim.HasAttribute("inputs:texture:file") else None
    if file and file.resolvedPath:
        # s runs along the light's x, seen from the back; the shape below is turned about y.
        flip = [[-1, 0, 1], [0, 1, 0], [0, 0, 1]]
        shine = mitsuba_materials.picture([[file.resolvedPath, 0, 0]], "auto", "rgb", "clamp", flip, value.tolist())
    return {
        "type": kind, "to_world": matrix(place @ local), "emitter": {"type": "area", "radiance": shine},
        "bsdf": {"type": "diffuse", "reflectance": rgb((0, 0, 0))} if blocks else {"type": "null"},
    }  # fmt: skip


def form(prim: Usd.Prim, place: np.ndarray, time) -> tuple[np.ndarray, str, np.ndarray, float]:
    """Radiance, Mitsuba's type, its matrix in the light's space, the area in the world."""
    value, (sx, sy, sz) = radiance(prim, time), np.linalg.norm(place[:3, :3], axis=0)
    radius = get(prim, "radius", 0.5, time)
    # Rectangles and disks shine along -z: turned about y.
    if prim.IsA(UsdLux.RectLight):
        width, height = get(prim, "width", 1.0, time), get(prim, "height", 1.0, time)
        return value, "rectangle", np.diag([-width / 2, height / 2, -1.0, 1.0]), width * height * sx * sy
    if prim.IsA(UsdLux.DiskLight):
        return value, "disk", np.diag([-radius, radius, -1.0, 1.0]), math.pi * radius**2 * sx * sy
    if prim.IsA(UsdLux.SphereLight):
        return value, "sphere", np.diag([radius] * 3 + [1.0]), 4 * math.pi * radius**2 * (sx * sy * sz) ** (2 / 3)
    length = get(prim, "length", 1.0, time)
    # Mitsuba's axis is z from 0 to 1; UsdLux's is x about the middle.
    local = np.array([[0, 0, length, -length / 2], [radius, 0, 0, 0], [0, radius, 0, 0], [0, 0, 0, 1.0]])
    return value, "cylinder", local, 2 * math.pi * radius * length * sx * math.sqrt(sy * sz)


def spot(prim, place, power: np.ndarray, angle: float, kind: str, time) -> dict:
    """Radiance times area is the intensity along the axis. A flat light has the mean of its cosine within the cone, a
    sphere shows a quarter of its area."""
    softness = min(max(get(prim, "shaping:cone:softness", 0.0, time), 0.0), 1.0)
    shown = 0.25 if kind == "sphere" else (1 + math.cos(math.radians(angle * (1 - softness / 2)))) / 2
    turn = place[:3, :3] / np.linalg.norm(place[:3, :3], axis=0)
    to_world = np.eye(4)
    # Mitsuba's shines along +z.
    to_world[:3, :3], to_world[:3, 3] = turn @ np.diag([-1.0, 1.0, -1.0]), place[:3, 3]
    return {
        "type": "spot", "to_world": matrix(to_world), "intensity": rgb(power * shown),
        "cutoff_angle": float(angle), "beam_width": float(angle) * (1 - softness) * 0.999,
    }  # fmt: skip


def sun(prim: Usd.Prim, place: np.ndarray, time, ball: tuple) -> dict:
    """`directional`, or with an angle a far disk of that size."""
    value, half = radiance(prim, time), math.radians(get(prim, "angle", 0.53, time)) / 2
    way = -place[:3, 2] / np.linalg.norm(place[:3, 2])
    if half == 0:
        return {"type": "directional", "direction": way.tolist(), "irradiance": rgb(value)}
    if get(prim, "normalize", False, time):
        value = value / (math.pi * math.sin(half) ** 2)
    distance = FAR * ball[1]
    side = np.cross([0.0, 1.0, 0.0] if abs(way[1]) < 0.9 else [1.0, 0.0, 0.0], way)
    side /= np.linalg.norm(side)
    size = distance * math.tan(half)
    to_world = np.eye(4)
    to_world[:3] = np.stack([size * side, size * np.cross(way, side), way, ball[0] - distance * way], 1)
    black = {"type": "diffuse", "reflectance": rgb((0, 0, 0))}
    return {
        "type": "disk", "to_world": matrix(to_world), "emitter": {"type": "area", "radiance": rgb(value)}, "bsdf": black
    }  # fmt: skip


def dome(prim: Usd.Prim, place: np.ndarray, time) -> dict:
    file, value = get(prim, "texture:file", None, time), radiance(prim, time)
    if file is None or not file.resolvedPath:
        return {"type": "constant", "radiance": rgb(value)}
    turn = place[:3, :3] / np.linalg.norm(place[:3, :3], axis=0)
    if prim.IsA(UsdLux.DomeLight_1):
        pole, up = prim.GetAttribute("poleAxis").Get(time), UsdGeom.GetStageUpAxis(prim.GetStage())
        if pole == "Z" or (pole == "scene" and up == UsdGeom.Tokens.z):
            turn = turn @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    to_world = np.eye(4)
    to_world[:3, :3] = turn
    made = mitsuba_materials.picture([[file.resolvedPath, 0, 0]], "auto", "rgb", "repeat", np.eye(3), value.tolist())
    return {"type": "envmap", "to_world": matrix(to_world), "picture": made["picture"]}


def sensor(stage: Usd.Stage, path: str, time, width: int, height: int) -> dict:
    """The camera; its window is matched vertically, as OpenUSD's tools do."""
    cameras = [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Camera)]
    named = [prim for prim in cameras if str(prim.GetPath()) == path or prim.GetName() == path]
    camera = UsdGeom.Camera((named or cameras)[0]).GetCamera(time)
    window = camera.frustum.window
    half = (window.max[1] - window.min[1]) / 2
    # Mitsuba's looks along +z with +x to the left.
    place = columns(camera.transform) @ np.diag([-1.0, 1.0, -1.0, 1.0])
    made: dict = {
        "film": {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"},
            "pixel_format": "rgb", "component_format": "float32"},
        "sampler": {"type": "multijitter"}, "near_clip": camera.clippingRange.min, "far_clip": camera.clippingRange.max,
    }  # fmt: skip
    if camera.projection == camera.Orthographic:
        place = place @ np.diag([half * width / height, half * width / height, 1.0, 1.0])
        return {"type": "orthographic", "to_world": matrix(place), **made}
    made |= {
        "type": "perspective", "to_world": matrix(place), "fov": 2 * math.degrees(math.atan(half)), "fov_axis": "y",
        "principal_point_offset_x": -camera.horizontalApertureOffset / camera.verticalAperture * height / width,
        "principal_point_offset_y": camera.verticalApertureOffset / camera.verticalAperture,
    }  # fmt: skip
    if camera.fStop:
        # A focal length is in tenths of the stage's unit.
        lens = camera.focalLength / 10 / (2 * camera.fStop)
        made |= {"type": "thinlens", "aperture_radius": lens, "focus_distance": camera.focusDistance}
    return made


class Writer:
    """Shapes, materials and instances of a scene, and the files that they need."""

    def __init__(self, folder: pathlib.Path, time, most: int, notes: Notes) -> None:
        self.entries: dict = {}
        self._folder, self._time, self._most, self.notes = folder, time, most, notes
        self._materials: dict[str, tuple[str, dict | None]] = {}
        self._names: dict[str, str] = {}
        self._glowing: dict[str, list[Mesh]] = {}
        self.stored = self.flattened = self.instances = self.groups = 0
        self.low, self.high = np.full(3, np.inf), np.full(3, -np.inf)

    def leaf(self, prim: Usd.Prim, places: np.ndarray) -> None:
        """A prim in all of its places."""
        shapes, points = self._shapes(prim, places)
        for local in places if len(points) else ():
            moved = points @ local[:3, :3].T + local[:3, 3]
            self.low, self.high = np.minimum(self.low, moved.min(0)), np.maximum(self.high, moved.max(0))
        self.flattened += self._last * len(places)
        if self.stored > self._most:
            raise TooLarge(f"more than {self._most} triangles, {self.flattened} flattened so far")
        if not shapes:
            return
        if len(places) == 1 and shapes[0]["type"] not in ("bsplinecurve", "linearcurve", "ellipsoids"):
            for shape in shapes:
                self._enter("shape", {**shape, "to_world": matrix(places[0] @ _of(shape))})
        else:
            self.groups += 1
            self.instances += len(places)
            name = f"group{self.groups}"
            inside = {f"shape{number}": shape for number, shape in enumerate(shapes)}
            rest = np.eye(4)
            if shapes[0]["type"] == "ellipsoids":
                # Small ones do not block all rays: the group's are of the size 1.
                rest = np.diag([shapes[0].pop("size")] * 3 + [1.0])
            np.save(self._folder / f"{name}.npy", (places @ rest).astype(np.float32))
            self.entries[name] = {"type": "shapegroup", **inside}
            self.entries[f"{name}_places"] = {"places": f"{name}.npy", "group": name}

    def finish(self) -> None:
        """Enters what shines: one shape for all that looks the same, as Mitsuba has no emitters in groups, and chooses
        among emitters without regard to their power."""
        for number, (key, parts) in enumerate(self._glowing.items()):
            look, shine = json.loads(key)[:2]
            ends = np.cumsum([0] + [len(part.points) for part in parts])
            faces = np.concatenate([part.faces + start for part, start in zip(parts, ends)])
            take = lambda name: None if getattr(parts[0], name) is None else np.concatenate(
                [getattr(part, name) for part in parts]
            )  # fmt: skip
            whole = Mesh(take("points"), take("normals"), take("st"), faces, parts[0].material)
            for side, part in enumerate((whole, whole.backs())):
                file = f"glow{number}_{side}.ply"
                part.write(self._folder / file)
                self._enter("shape", {
                    "type": "ply", "filename": file, "face_normals": part.normals is None, "bsdf": look,
                    "emitter": {"type": "area", "radiance": shine},
                })  # fmt: skip

    _last = 0
    """Triangles of the last prim."""

    def _enter(self, kind: str, entry: dict) -> None:
        self.entries[f"{kind}{len(self.entries)}"] = entry

    def _count(self, number: int) -> None:
        self._last = number
        self.stored += number

    def _shapes(self, prim: Usd.Prim, places: np.ndarray) -> tuple[list[dict], np.ndarray]:
        """Entries in the prim's own space and corners of a box about them; what shines is kept for the end."""
        name = f"part{len(self.entries)}"
        self._last, none = 0, np.zeros((0, 3))
        if prim.IsA(UsdGeom.Mesh):
            return self._meshes(prim, name, places)
        if prim.IsA(UsdGeom.BasisCurves):
            kind, made = strands(prim, self._time, self.notes)
            if not made:
                return [], none
            write_strands(self._folder / f"{name}.txt", made)
            self._count(sum(len(strand) for strand in made))
            entry = {"type": kind, "filename": f"{name}.txt", "bsdf": self._look(bound(prim), prim)[0]}
            return [entry], _corners(np.concatenate(made)[:, :3])
        if prim.IsA(UsdGeom.Points):
            made = balls(prim, self._time, self.notes)
            if not len(made):
                return [], none
            size = float(np.median(made[:, 3])) or 1.0
            np.save(self._folder / f"{name}.npy", (made / size).astype(np.float32))
            self._count(len(made))
            look = self._look(bound(prim), prim)[0]
            entry = {"type": "ellipsoids", "points": f"{name}.npy", "extent": 1.0, "size": size, "bsdf": look}
            return [entry], _corners(made[:, :3])
        if prim.IsA(UsdGeom.Sphere) or prim.IsA(UsdGeom.Cube):
            is_ball = prim.IsA(UsdGeom.Sphere)
            attribute = UsdGeom.Sphere(prim).GetRadiusAttr() if is_ball else UsdGeom.Cube(prim).GetSizeAttr()
            half = float(attribute.Get(self._time)) * (1.0 if is_ball else 0.5)
            entry = {
                "type": "sphere" if is_ball else "cube", "to_world": matrix(np.diag([half] * 3 + [1.0])),
                "bsdf": self._look(bound(prim), prim)[0],
            }  # fmt: skip
            return [entry], half * _corners(np.array([[-1.0] * 3, [1.0] * 3]))
        self.notes.add(f"{prim.GetTypeName()} prims", prim)
        return [], none

    def _meshes(self, prim: Usd.Prim, name: str, places: np.ndarray) -> tuple[list[dict], np.ndarray]:
        found, entries = meshes(prim, self._time, self.notes), []
        self._count(sum(len(mesh.faces) for mesh in found))
        if not found:
            return [], np.zeros((0, 3))
        own = rgb(radiance(prim, self._time)) if prim.HasAPI(UsdLux.MeshLightAPI) else None
        for number, mesh in enumerate(found):
            look, shine = self._look(mesh.material, prim)
            if shine := own or shine:
                self.stored += (2 * len(places) - 1) * len(mesh.faces)
                if self.stored <= self._most:
                    kind = [look, shine, mesh.normals is None, mesh.st is None]
                    self._glowing.setdefault(json.dumps(kind), []).extend(mesh.moved(place) for place in places)
                continue
            mesh.write(self._folder / f"{name}_{number}.ply")
            is_flat = mesh.normals is None
            entries.append({"type": "ply", "filename": f"{name}_{number}.ply", "face_normals": is_flat, "bsdf": look})
        return entries, _corners(np.concatenate([mesh.points for mesh in found]))

    def _look(self, material, prim: Usd.Prim) -> tuple[dict, dict | None]:
        """A reference to a material's BSDF, and what it shines."""
        key = str(material.GetPath()) if material else ""
        if not material:
            colors = primvar(prim, "displayColor", self._time)
            color = (0.18,) * 3 if colors is None or not len(colors[0]) else tuple(colors[0].mean(0))
            if colors is not None and (colors[0] != colors[0][:1]).any():
                self.notes.add("a displayColor that varies, taken as its mean", prim)
            key = json.dumps([float(x) for x in color])
        if key not in self._materials:
            if material:
                entry, shine = mitsuba_materials.bsdf(material, self._time, self.notes)
            else:
                entry, shine = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": rgb(color)}}, None
            # Materials of the same values are one.
            name = self._names.setdefault(json.dumps(entry), f"material{len(self._names)}")
            self.entries[name] = entry
            self._materials[key] = name, shine
        name, shine = self._materials[key]
        return {"type": "ref", "id": name}, shine


def _of(shape: dict) -> np.ndarray:
    return np.array(shape["to_world"]["matrix"]) if "to_world" in shape else np.eye(4)


def _corners(points: np.ndarray) -> np.ndarray:
    """Of the box about points."""
    ends = np.stack([points.min(0), points.max(0)])
    return np.array([[ends[x, 0], ends[y, 1], ends[z, 2]] for x in (0, 1) for y in (0, 1) for z in (0, 1)])


def has_holes(entry) -> bool:
    return isinstance(entry, dict) and (entry.get("type") in ("mask", "null") or any(map(has_holes, entry.values())))


def translate(stage: Usd.Stage, folder: pathlib.Path, job: dict) -> dict:
    """Writes the scene into a folder; what was made of the stage and what was left out. Raises TooLarge."""
    start = clock.monotonic()
    time = Usd.TimeCode(float(job["frame"])) if job.get("frame") else Usd.TimeCode.EarliestTime()
    notes = Notes()
    writer = Writer(folder, time, job["triangles"], notes)
    lights = []
    found: dict = {}
    places = Places(time, job["instances"], notes)
    for prim in stage.GetPseudoRoot().GetChildren():
        places._add(found, places.below(prim))
    for leaf, matrices in places._whole(found).values():
        if any(leaf.IsA(kind) for kind in LIGHTS):
            lights += [(leaf, place) for place in matrices]
        else:
            writer.leaf(leaf, matrices)
    writer.finish()
    is_empty = not np.isfinite(writer.low).all()
    low, high = (np.zeros(3), np.ones(3)) if is_empty else (writer.low, writer.high)
    ball = (low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, 1e-6)
    # `path` counts holes as bounces and its shadow rays stop at them; `volpath` goes through.
    is_open = has_holes(writer.entries)
    domes = 0
    for number, (leaf, place) in enumerate(lights):
        entry = lamp(leaf, place, time, ball, not is_open, notes)
        domes += entry["type"] in ("envmap", "constant")
        if entry["type"] in ("envmap", "constant") and domes > 1:
            notes.add("a second dome light", leaf)
        else:
            writer.entries[f"lamp{number}"] = entry
    if job.get("shutter"):
        notes.add("motion: everything stands as at the frame", None)
    scene = {
        "type": "scene", "sensor": sensor(stage, job["camera"], time, job["width"], job["height"]),
        "integrator": {"type": "volpath" if is_open else "path", "max_depth": job["bounces"] + 2, "rr_depth": ROULETTE},
        **writer.entries,
    }  # fmt: skip
    (folder / "scene.json").write_text(json.dumps(scene))
    return {
        "seconds": clock.monotonic() - start, "triangles": writer.stored, "flattened": writer.flattened,
        "groups": writer.groups, "instances": writer.instances, "lights": len(lights), "left_out": notes.told(),
    }  # fmt: skip


def main() -> int:
    job = json.loads(pathlib.Path(sys.argv[1]).read_text())
    try:
        said = translate(Usd.Stage.Open(job["scene"]), pathlib.Path(job["out"]), job)
    except TooLarge as error:
        said = {"refused": str(error)}
    print("RESULT " + json.dumps({"kind": "scene", **said}), flush=True)
    return 1 if "refused" in said else 0


if __name__ == "__main__":
    sys.exit(main())
