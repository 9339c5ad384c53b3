#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes the forest: a displaced terrain with instances of 16 meshes in nested point instancers, a dome, a sun, a
camera.

    forest.py OUT.usdc [--instances 100000] [--terrain 224] [--seed 7]

`--instances` counts leaf placements (a clump of 30 plants counts 30); the scene holds exactly that many. `--terrain` is
the number of quads along one side of the ground. Same arguments, same scene. Needs usd-core (or any pxr) and numpy.

Layout of the stage:
    /World/Terrain            mesh, 2 * terrain^2 triangles, smooth normals, vertex colours
    /World/Ridge0 ...         the hazy mountains behind
    /World/Groves             point instancer of the clumps: the nesting
    /World/Groves/Prototypes/NAME    16 meshes, uniform colours
    /World/Groves/Clumps/KIND        8 point instancers of those meshes: a few plants each
    /World/Trees              point instancer of single meshes
    /World/Sun, /World/Sky, /World/Camera
"""

from __future__ import annotations

import argparse

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, Vt

import plants
from plants import rgb

SIDE = 420.0
"""Length of the terrain, metres."""

CLUMPS = {
    # kind: (radius, [(prototype, how many, least and greatest scale)])
    "spruces": (
        8.0,
        [
            ("conifer_tall", 4, 0.7, 1.15), ("conifer_wide", 3, 0.6, 1.1), ("conifer_young", 4, 0.5, 1.2),
            ("tuft_fern", 8, 0.7, 1.3), ("rock_log", 1, 0.7, 1.0),
        ],
    ),
    "firs": (
        7.0,
        [
            ("conifer_blue", 4, 0.7, 1.2), ("conifer_tall", 2, 0.6, 0.9), ("conifer_young", 5, 0.4, 1.0),
            ("bush_low", 6, 0.7, 1.2),
        ],
    ),
    "birches": (6.5, [("broadleaf_birch", 5, 0.75, 1.15), ("bush_low", 4, 0.8, 1.3), ("tuft_grass", 12, 0.7, 1.2)]),
    "autumn": (
        7.5,
        [
            ("broadleaf_gold", 2, 0.8, 1.15), ("broadleaf_orange", 2, 0.7, 1.1), ("broadleaf_maple", 1, 0.8, 1.2),
            ("bush_red", 4, 0.7, 1.3), ("tuft_fern", 10, 0.8, 1.3),
        ],
    ),
    "mixed": (
        8.0,
        [
            ("broadleaf_green", 2, 0.8, 1.1), ("broadleaf_gold", 1, 0.7, 1.0), ("conifer_wide", 2, 0.7, 1.0),
            ("bush_green", 5, 0.8, 1.5), ("tuft_fern", 9, 0.7, 1.3),
        ],
    ),
    "shrubs": (
        3.5,
        [
            ("bush_green", 3, 0.7, 1.4), ("bush_red", 2, 0.6, 1.2), ("bush_low", 6, 0.7, 1.4),
            ("tuft_grass", 14, 0.7, 1.3),
        ],
    ),
    "meadow": (3.0, [("tuft_grass", 26, 0.6, 1.3), ("tuft_fern", 3, 0.6, 1.0), ("bush_low", 1, 0.4, 0.9)]),
    "stones": (3.5, [("rock_boulder", 6, 0.25, 1.3), ("tuft_grass", 9, 0.6, 1.1), ("bush_low", 3, 0.5, 1.0)]),
}


class Noise:
    """Smooth value noise in the plane, summed over octaves; values about -1 .. 1."""

    def __init__(self, seed: int) -> None:
        self._table = np.random.default_rng(seed).uniform(-1.0, 1.0, (256, 256))

    def _once(self, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        ix, iz = np.floor(x).astype(int), np.floor(z).astype(int)
        fx, fz = x - ix, z - iz
        fx, fz = fx**3 * (fx * (6 * fx - 15) + 10), fz**3 * (fz * (6 * fz - 15) + 10)
        at = lambda dx, dz: self._table[(ix + dx) % 256, (iz + dz) % 256]
        near = at(0, 0) * (1 - fx) + at(1, 0) * fx
        far = at(0, 1) * (1 - fx) + at(1, 1) * fx
        return near * (1 - fz) + far * fz

    def __call__(self, x: np.ndarray, z: np.ndarray, wavelength: float, octaves: int) -> np.ndarray:
        total, weight = np.zeros_like(np.asarray(x, dtype=np.float64)), 1.0
        for octave in range(octaves):
            turn = 0.6 * octave
            u = (x * np.cos(turn) - z * np.sin(turn)) / wavelength + 17.3 * octave
            v = (x * np.sin(turn) + z * np.cos(turn)) / wavelength + 5.1 * octave
            total += weight * self._once(u, v)
            weight, wavelength = weight * 0.5, wavelength * 0.5
        return total


class Land:
    """Heights, slopes and what grows where. +x is right, -z is away from the camera."""

    def __init__(self, seed: int) -> None:
        self._hills, self._patches = Noise(seed), Noise(seed + 1)

    def path_x(self, z: np.ndarray) -> np.ndarray:
        """Where the footpath runs."""
        return 9.0 * np.sin(z / 27.0 + 0.6) + 14.0 * np.sin(z / 71.0) - 3.0

    def height(self, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        valley = np.abs(x - self.path_x(z))
        banks = 24.0 * (1.0 - np.exp(-((valley / 95.0) ** 2)))
        rise = 22.0 / (1.0 + np.exp((z + 110.0) / 24.0))
        rough = self._hills(x, z, 95.0, 5) * (2.2 + 4.0 * np.clip(valley / 60.0, 0.0, 1.0))
        return banks + rise + rough

    def normal(self, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        step = 0.5
        dx = (self.height(x + step, z) - self.height(x - step, z)) / (2 * step)
        dz = (self.height(x, z + step) - self.height(x, z - step)) / (2 * step)
        normal = np.stack([-dx, np.ones_like(dx), -dz], axis=-1)
        return normal / np.linalg.norm(normal, axis=-1, keepdims=True)

    def off_path(self, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        return np.abs(x - self.path_x(z))

    def patch(self, x: np.ndarray, z: np.ndarray, wavelength: float, shift: float) -> np.ndarray:
        return self._patches(x + shift, z - shift, wavelength, 3)


def add_mesh(
    stage: Usd.Stage, path: str, points, counts, indices, colors, interpolation: str, normals=None, double_sided=False
) -> UsdGeom.Mesh:
    """Defines a polygon mesh with displayColor, an extent and no subdivision."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points, dtype=np.float32)))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(counts, dtype=np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(indices, dtype=np.int32)))
    mesh.CreateDoubleSidedAttr(double_sided)
    mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(mesh.GetPointsAttr().Get()))
    color = mesh.CreateDisplayColorPrimvar(interpolation)
    color.Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(colors, dtype=np.float32)))
    if normals is not None:
        mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(normals, dtype=np.float32)))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    return mesh


def grid(count_x: int, count_z: int) -> tuple[np.ndarray, np.ndarray]:
    """Counts and indices of a grid of quads, rows along z, wound so that +y is outside."""
    row, column = np.meshgrid(np.arange(count_z), np.arange(count_x), indexing="ij")
    first = row * (count_x + 1) + column
    quads = np.stack([first, first + count_x + 1, first + count_x + 2, first + 1], axis=-1).reshape(-1)
    return np.full(count_x * count_z, 4, dtype=np.int32), quads


def add_terrain(stage: Usd.Stage, land: Land, resolution: int) -> None:
    line = np.linspace(-SIDE / 2, SIDE / 2, resolution + 1)
    z, x = (plane.reshape(-1) for plane in np.meshgrid(line, line, indexing="ij"))
    normal = land.normal(x, z)
    path = land.off_path(x, z) + 0.8 * land.patch(x, z, 6.0, 3.0)
    dry = np.clip(0.5 + 0.9 * land.patch(x, z, 34.0, 40.0), 0, 1)[:, None]
    soil = np.clip(0.5 + 1.2 * land.patch(x, z, 15.0, 90.0), 0, 1)[:, None]
    color = rgb("6f7434") * (1 - dry) + rgb("9c8a48") * dry
    color = color * (1 - 0.55 * soil) + rgb("5f4c31") * 0.55 * soil
    steep = np.clip((0.86 - normal[:, 1]) / 0.12, 0, 1)[:, None]
    color = color * (1 - steep) + rgb("77716a") * steep
    trodden = np.clip((2.3 - path) / 1.1, 0, 1)[:, None]
    color = color * (1 - trodden) + rgb("b29a73") * trodden
    color = color * np.exp(0.10 * land.patch(x, z, 4.0, 11.0))[:, None]
    counts, quads = grid(resolution, resolution)
    height = land.height(x, z) - 0.16 * trodden[:, 0]
    add_mesh(
        stage, "/World/Terrain", np.stack([x, height, z], axis=1), counts, quads, color, UsdGeom.Tokens.vertex, normal
    )


def add_ridges(stage: Usd.Stage, seed: int) -> None:
    """Three rows of mountains; the farther, the paler and bluer, as air would make them."""
    noise = Noise(seed + 2)
    tones = ["56675c", "7c93a0", "a9bfcd"]
    for index, (distance, peak, tone) in enumerate(zip((340.0, 640.0, 1200.0), (88.0, 190.0, 420.0), tones)):
        x, depth = np.meshgrid(np.linspace(-2.2 * distance, 2.2 * distance, 161), np.linspace(0.0, 1.0, 25))
        x, depth = x.reshape(-1), depth.reshape(-1)
        z = -distance - depth * distance * 0.5
        crest = 0.60 + 0.60 * noise(x, z * 0.35 + 900.0 * index, distance * 0.42, 5)
        height = peak * np.clip(crest, 0.12, None) * np.sin(np.clip(depth, 0, 1) * np.pi * 0.62) - 6.0
        color = rgb(tone) * np.exp(0.12 * noise(x, height * 2.0, distance * 0.12, 2))[:, None]
        snow = np.clip((height / peak - 0.62 + 0.08 * noise(x, z, distance * 0.2, 2)) * 6.0, 0, 1)[:, None] * (
            index == 2
        )
        color = color * (1 - snow) + rgb("e4ebf2") * snow
        points = np.stack([x, height, z], axis=1)
        rows = points.reshape(25, 161, 3)
        normal = np.cross(np.gradient(rows, axis=1), np.gradient(rows, axis=0)).reshape(-1, 3)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        counts, quads = grid(160, 24)
        quads = quads.reshape(-1, 4)[:, ::-1].reshape(-1)
        add_mesh(
            stage, f"/World/Ridge{index}", points, counts, quads, color, UsdGeom.Tokens.vertex, normal,
            double_sided=True,
        )


def quaternions(yaw: np.ndarray, up: np.ndarray) -> np.ndarray:
    """(w, x, y, z): first a turn about y, then the shortest turn that takes y to `up`."""
    turn = np.stack([np.cos(yaw / 2), 0 * yaw, np.sin(yaw / 2), 0 * yaw], axis=1)
    tilt = np.stack([1.0 + up[:, 1], up[:, 2], 0 * yaw, -up[:, 0]], axis=1)
    tilt /= np.linalg.norm(tilt, axis=1, keepdims=True)
    (a, b, c, d), (e, f, g, h) = tilt.T, turn.T
    product = [
        a * e - b * f - c * g - d * h, a * f + b * e + c * h - d * g, a * g - b * h + c * e + d * f,
        a * h + b * g - c * f + d * e,
    ]
    return np.stack(product, axis=1)


def add_instancer(stage: Usd.Stage, path: str, prototypes: list[str], kinds, positions, rotations, scales) -> None:
    instancer = UsdGeom.PointInstancer.Define(stage, path)
    instancer.CreatePrototypesRel().SetTargets([Sdf.Path(target) for target in prototypes])
    instancer.CreateProtoIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(kinds, dtype=np.int32)))
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(positions, dtype=np.float32)))
    # Vt keeps quaternions as (x, y, z, w).
    orientations = np.ascontiguousarray(np.roll(rotations, -1, axis=1), dtype=np.float16)
    instancer.CreateOrientationsAttr(Vt.QuathArray.FromNumpy(orientations))
    instancer.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(scales, dtype=np.float32)))


def add_clumps(stage: Usd.Stage, names: list[str], seed: int) -> dict[str, int]:
    """The small instancers; returns how many plants each clump holds."""
    sizes = {}
    for kind, (radius, members) in CLUMPS.items():
        rng = np.random.default_rng([seed, len(sizes)])
        used = [name for name, *_ in members]
        proto = np.concatenate([np.full(count, index) for index, (_, count, *_) in enumerate(members)])
        low = np.concatenate([np.full(count, low) for _, count, low, _ in members])
        high = np.concatenate([np.full(count, high) for _, count, _, high in members])
        # A sunflower disk with jitter: no two trees in one place, and the big ones spread out.
        spots = (np.arange(len(proto)) * 7 + 3) % len(proto) if len(proto) % 7 else np.arange(len(proto))
        angle = spots * 2.39996 + rng.uniform(-0.3, 0.3, len(proto))
        out = radius * np.sqrt((spots + 0.5) / len(proto)) * rng.uniform(0.85, 1.1, len(proto))
        size = low + (high - low) * rng.uniform(0, 1, len(proto)) ** 1.3
        position = np.stack([np.cos(angle) * out, -0.06 - 0.02 * size, np.sin(angle) * out], axis=1)
        scale = size[:, None] * np.array([1, 1, 1]) * np.exp(rng.normal(0.0, 0.06, (len(proto), 3)))
        rotation = quaternions(rng.uniform(0, 2 * np.pi, len(proto)), np.tile([0.0, 1.0, 0.0], (len(proto), 1)))
        targets = [f"/World/Groves/Prototypes/{name}" for name in used]
        add_instancer(stage, f"/World/Groves/Clumps/{kind}", targets, proto, position, rotation, scale)
        sizes[kind] = len(proto)
    unknown = {member[0] for _, members in CLUMPS.values() for member in members} - set(names)
    if unknown:
        raise ValueError(f"clumps use unknown prototypes {sorted(unknown)}")
    return sizes


def scatter(rng: np.random.Generator, land: Land, count: int, weight) -> tuple[np.ndarray, np.ndarray]:
    """`count` places of a jittered grid, drawn without replacement in proportion to weight(x, z)."""
    cells = int(np.ceil(np.sqrt(max(count, 1) * 5.0)))
    cell = SIDE * 0.985 / cells
    line = (np.arange(cells) + 0.5) * cell - SIDE * 0.985 / 2
    x, z = (plane.reshape(-1) for plane in np.meshgrid(line, line))
    x, z = (plane + rng.uniform(-0.48, 0.48, plane.shape) * cell for plane in (x, z))
    keys = np.log(np.maximum(weight(x, z), 1e-9)) + rng.gumbel(size=x.shape)
    chosen = np.argsort(-keys, kind="stable")[:count]
    return x[chosen], z[chosen]


def clump_weights(land: Land, x: np.ndarray, z: np.ndarray) -> dict[str, np.ndarray]:
    """How gladly each clump grows at a place."""
    path = land.off_path(x, z)
    wood = 1 / (1 + np.exp(-6.0 * (land.patch(x, z, 62.0, 0.0) - 0.05 + 0.012 * (path - 26.0))))
    high = np.clip((land.height(x, z) - 14.0) / 16.0, 0, 1)
    # No tree within the camera's first thirty metres.
    clear = np.clip((path - 7.0) / 6.0, 0, 1) * np.clip((np.hypot((x - 3.0) * 0.9, z - 165.0) - 30.0) / 8.0, 0, 1)
    verge = np.clip((path - 2.9) / 1.2, 0, 1)
    leaf = np.clip(0.5 + 1.1 * land.patch(x, z, 45.0, 70.0), 0.02, 1)
    stony = np.clip(land.patch(x, z, 28.0, 130.0) - 0.2, 0, 1)
    return {
        "spruces": 1.5 * wood * clear * (0.25 + high) * (1.05 - leaf),
        "firs": 1.1 * wood * clear * (0.2 + high) * (1.05 - leaf),
        "birches": 0.55 * clear * (0.25 + wood) * leaf * (1 - 0.7 * high),
        "autumn": 0.8 * wood * clear * leaf * (1.05 - high),
        "mixed": 0.7 * wood * clear * (1.05 - 0.6 * high),
        "shrubs": 0.45 * verge * (0.35 + wood),
        "meadow": 1.5 * verge * (1.15 - wood),
        "stones": verge * stony * 0.9,
    }


def add_forest(stage: Usd.Stage, land: Land, names: list[str], sizes: dict[str, int], total: int, seed: int) -> None:
    rng = np.random.default_rng([seed, 99])
    kinds = list(CLUMPS)
    mean_size = sum(sizes.values()) / len(sizes)
    wanted = int(total * 0.9 / mean_size)
    x, z = scatter(rng, land, wanted, lambda x, z: sum(clump_weights(land, x, z).values()))
    weights = np.stack([clump_weights(land, x, z)[kind] for kind in kinds], axis=1) + 1e-9
    pick = (weights.cumsum(axis=1) < rng.uniform(0, 1, (len(x), 1)) * weights.sum(axis=1, keepdims=True)).sum(axis=1)
    plants_in = np.array([sizes[kind] for kind in kinds])[pick]
    keep = np.cumsum(plants_in) <= total
    x, z, pick = x[keep], z[keep], pick[keep]
    singles = total - int(plants_in[keep].sum())

    up = land.normal(x, z)
    low_growth = np.isin(np.array(kinds)[pick], ["shrubs", "meadow", "stones"])[:, None]
    # Trees lean only a little towards the slope, undergrowth follows it.
    up = up * np.where(low_growth, 1.0, 0.35) + [0.0, 1.0, 0.0] * np.where(low_growth, 0.0, 0.65)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    sink = np.where(low_growth[:, 0], 0.05, 0.35 + 3.0 * (1 - land.normal(x, z)[:, 1]))
    position = np.stack([x, land.height(x, z) - sink, z], axis=1)
    rotation = quaternions(rng.uniform(0, 2 * np.pi, len(x)), up)
    size = np.exp(rng.normal(0.0, 0.10, len(x)))[:, None] * np.ones(3)
    targets = [f"/World/Groves/Clumps/{kind}" for kind in kinds]
    add_instancer(stage, "/World/Groves", targets, pick, position, rotation, size)

    share = {
        name: {"conifer": 1.2, "broadleaf": 0.8, "bush": 1.2, "tuft": 3.0, "rock": 0.35}[name.split("_")[0]]
        for name in names
    }
    chance = np.array([share[name] for name in names])
    pick = rng.choice(len(names), singles, p=chance / chance.sum())
    trees = np.array([name.split("_")[0] in ("conifer", "broadleaf") for name in names])[pick]
    place = np.zeros((2, singles))
    for is_tree in (False, True):
        members = trees == is_tree
        gate = (
            (lambda x, z: clump_weights(land, x, z)["mixed"] + 0.2 * clump_weights(land, x, z)["birches"])
            if is_tree
            else (lambda x, z: np.clip((land.off_path(x, z) - 2.6) / 2.0, 0, 1))
        )
        found = scatter(rng, land, int(members.sum()), gate)
        place[:, members] = np.stack(found)
    x, z = place
    position = np.stack([x, land.height(x, z) - np.where(trees, 0.2, 0.04), z], axis=1)
    rotation = quaternions(rng.uniform(0, 2 * np.pi, singles), np.tile([0.0, 1.0, 0.0], (singles, 1)))
    size = rng.uniform(0.55, 1.2, (singles, 1)) * np.ones(3)
    add_instancer(
        stage, "/World/Trees", [f"/World/Groves/Prototypes/{name}" for name in names], pick, position, rotation, size
    )


def add_lights(stage: Usd.Stage) -> None:
    sky = UsdLux.DomeLight.Define(stage, "/World/Sky")
    sky.CreateColorAttr(Gf.Vec3f(0.52, 0.72, 1.0))
    sky.CreateIntensityAttr(0.62)
    sun = UsdLux.DistantLight.Define(stage, "/World/Sun")
    sun.CreateAngleAttr(0.9)
    sun.CreateColorAttr(Gf.Vec3f(1.0, 0.80, 0.56))
    # normalize: the intensity is the irradiance on a surface that faces the sun.
    sun.CreateNormalizeAttr(True)
    sun.CreateIntensityAttr(4.6)
    sun.AddRotateYOp().Set(-68.0)
    sun.AddRotateXOp().Set(-27.0)


def add_camera(stage: Usd.Stage, land: Land) -> None:
    eye = Gf.Vec3d(3.0, 0.0, 172.0)
    eye[1] = float(land.height(np.array(eye[0]), np.array(eye[2]))) + 9.0
    target = Gf.Vec3d(-6.0, 0.0, 60.0)
    target[1] = float(land.height(np.array(target[0]), np.array(target[2]))) + 6.5
    camera = UsdGeom.Camera.Define(stage, "/World/Camera")
    look = Gf.Matrix4d().SetLookAt(eye, target, Gf.Vec3d(0, 1, 0)).GetInverse()
    camera.AddTransformOp().Set(look)
    # Lengths are in tenths of a scene unit: 0.36 is 36 mm when the unit is a metre.
    camera.CreateHorizontalApertureAttr(0.36)
    camera.CreateVerticalApertureAttr(0.36 * 9 / 16)
    camera.CreateFocalLengthAttr(0.32)
    camera.CreateFStopAttr(1.8)
    camera.CreateFocusDistanceAttr((target - eye).GetLength() * 0.55)
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.1, 5000.0))


def build(path: str, instances: int = 100_000, terrain: int = 224, seed: int = 7) -> Usd.Stage:
    """Makes and saves the scene; returns its stage."""
    if instances < 100 or terrain < 2:
        raise ValueError("at least 100 instances and 2 terrain quads per side")
    stage = Usd.Stage.CreateNew(path)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    land = Land(seed)
    add_terrain(stage, land, terrain)
    add_ridges(stage, seed)
    # Prototypes live below an instancer, so that they show only through instancers.
    UsdGeom.PointInstancer.Define(stage, "/World/Groves")
    for scope in ("/World/Groves/Prototypes", "/World/Groves/Clumps"):
        UsdGeom.Scope.Define(stage, scope)
    soups = plants.all_sixteen(seed)
    for name, soup in soups.items():
        points, counts, indices, colors = soup.arrays()
        add_mesh(
            stage, f"/World/Groves/Prototypes/{name}", points, counts, indices, colors, UsdGeom.Tokens.uniform,
            double_sided=True,
        )
    names = list(soups)
    sizes = add_clumps(stage, names, seed)
    add_forest(stage, land, names, sizes, instances, seed)
    add_lights(stage)
    add_camera(stage, land)
    stage.Save()
    return stage


def count_instances(stage: Usd.Stage) -> int:
    """Leaf placements the instancers make, counted from the saved arrays."""
    clump = lambda target: len(UsdGeom.PointInstancer(stage.GetPrimAtPath(target)).GetProtoIndicesAttr().Get())
    groves = UsdGeom.PointInstancer(stage.GetPrimAtPath("/World/Groves"))
    sizes = np.array([clump(target) for target in groves.GetPrototypesRel().GetTargets()])
    trees = UsdGeom.PointInstancer(stage.GetPrimAtPath("/World/Trees"))
    return int(sizes[np.array(groves.GetProtoIndicesAttr().Get())].sum()) + len(trees.GetProtoIndicesAttr().Get())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out")
    parser.add_argument("--instances", type=int, default=100_000)
    parser.add_argument("--terrain", type=int, default=224)
    parser.add_argument("--seed", type=int, default=7)
    arguments = parser.parse_args()
    stage = build(arguments.out, arguments.instances, arguments.terrain, arguments.seed)
    print(f"{arguments.out}: {count_instances(stage)} instances, {2 * arguments.terrain**2} terrain triangles")


if __name__ == "__main__":
    main()
