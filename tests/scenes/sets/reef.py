# SPDX-License-Identifier: Apache-2.0
"""A coral reef in centimetres, z up: a displaced subdivided seabed, corals as instanced meshes in colonies that are
instanced in turn, seaweed and kelp as cubic curves, sand and bubbles as points.

    python -m sets.reef FOLDER [--seed N] [--size S] [--texture N]

Even seeds are for tuning, odd seeds are held out (see the package).
"""

from __future__ import annotations

import pathlib

import numpy as np
from pxr import Gf, Sdf, UsdLux, Vt

import shading
from . import shapes
from .layer import Layer, many, picture, run

AXIS = ("Z", 0.01)
COLORS = [(0.75, 0.28, 0.2), (0.8, 0.55, 0.2), (0.55, 0.25, 0.6), (0.3, 0.55, 0.4), (0.85, 0.75, 0.55), (0.7, 0.2, 0.4)]


def height(x, y):
    """The seabed without its displacement: a slope with mounds and a sand channel along y."""
    mounds = 1.1 * np.sin(x * 0.21 + 1.0) * np.cos(y * 0.17) + 0.35 * np.sin(x * 0.6 + y * 0.43)
    return mounds * np.clip(np.abs(x) / 4.0, 0, 1) + 0.04 * y


def branch(rng, start, way, length, radius, depth) -> list[shapes.Shape]:
    """A branching coral as tubes."""
    steps = np.linspace(0, 1, 7)[:, None]
    bend = rng.normal(size=3) * 0.2
    line = start + way * length * steps + bend * length * steps**2
    made = [shapes.tube(line, radius * (1 - 0.35 * steps[:, 0]), 8)]
    if depth:
        for _ in range(rng.integers(2, 4)):
            next_way = way + rng.normal(size=3) * 0.55 + [0, 0, 0.25]
            next_way /= np.linalg.norm(next_way)
            at = line[rng.integers(3, 7)]
            made += branch(rng, at, next_way, length * rng.uniform(0.6, 0.85), radius * 0.65, depth - 1)
    return made


def coral(rng, kind: int, size: float) -> shapes.Shape:
    """One of three forms, about 30 cm across."""
    if kind % 3 == 0:
        stems = [branch(rng, np.zeros(3), _up(rng), 0.12, 0.014, 3) for _ in range(4)]
        return shapes.joined([part for stem in stems for part in stem])
    if kind % 3 == 1:
        lump = shapes.blob(rng, many(40000, size, 600), 0.12, 0.75)
        angle, z = np.arctan2(lump.points[:, 1], lump.points[:, 0]), lump.points[:, 2]
        folds = 1 + 0.05 * np.sin(18 * z + 3 * np.sin(angle * 5)) * np.sin(angle * 7 + 6 * z)
        return shapes.moved(lump._replace(points=lump.points * folds[:, None]), (0, 0, 0.08), 0.16)
    wide = np.array([[0.02, 0.0], [0.03, 0.08], [0.12, 0.15], [0.3, 0.18], [0.31, 0.19], [0.1, 0.17], [0.0, 0.16]])
    table = shapes.lathe(wide, 64)
    ripple = 1 + 0.12 * np.sin(9 * np.arctan2(table.points[:, 1], table.points[:, 0]) + rng.uniform(0, 6))
    return table._replace(points=table.points * np.stack([ripple, ripple, np.ones_like(ripple)], -1))


def _up(rng):
    way = rng.normal(size=3) * 0.5 + [0, 0, 1]
    return way / np.linalg.norm(way)


def write_corals(folder: pathlib.Path, rng, size: float, texture: int, kinds: int) -> None:
    """Each coral a file of its own: polyps as a 16 bit height that bends normals, two colours as variants."""
    for kind in range(kinds):
        name = f"coral{kind:02}"
        base = shapes.noise(rng, max(texture // 4, 4), 1, 8)
        color = np.array(COLORS[kind % len(COLORS)])
        picture(folder / f"tex/{name}_color.png", color * (0.55 + 0.6 * base))
        picture(folder / f"tex/{name}_rough.png", 0.4 + 0.5 * shapes.noise(rng, max(texture // 4, 4)), 16)
        layer = Layer(folder / f"{name}.usdc", "Coral", *AXIS)
        surface = layer.look(
            "Coral", diffuseColor=layer.texture("Coral", "Color", f"./tex/{name}_color.png"),
            roughness=layer.texture("Coral", "Rough", f"./tex/{name}_rough.png", output="r", color_space="raw"),
        )
        shape = coral(rng, kind, size)
        layer.smooth(layer.mesh(layer.at("Skeleton"), shape, surface, double=kind % 3 == 2, st_scale=2.0), shape)
        layer.save()


def write_colony(folder: pathlib.Path, rng, size: float, number: int, kinds: int) -> None:
    """A rock on which corals stand: a point instancer whose prototypes are references, and tufts of weed."""
    layer = Layer(folder / f"colony{number}.usdc", "Colony", *AXIS, kind="assembly")
    rock = layer.look(
        "Rock", diffuseColor=layer.texture("Rock", "Color", "./tex/rock.png"), roughness=0.9,
        normal=shading.normal_map(layer.stage, layer.at("Looks/Rock/Normal"), "./tex/rock_normal.png"),
    )
    shape = shapes.blob(rng, many(60000, size, 1500), 0.5, 0.6)
    layer.smooth(layer.mesh(layer.at("Rock"), shape, rock), shape)
    used = rng.choice(kinds, min(5, kinds), replace=False)
    paths = [layer.at(f"Corals/Coral{kind:02}") for kind in used]
    count = many(60, 1.0)
    seat = shape.points[rng.integers(0, len(shape.points), 4 * count)]
    seat = seat[seat[:, 2] > 0.05][:count]
    lean = shapes.turns(rng, len(seat), 0.15)
    layer.instancer(
        layer.at("Corals"), paths, rng.integers(0, len(paths), len(seat)), seat * 0.97, lean,
        rng.uniform(0.5, 1.4, len(seat)),
    )
    for kind, path in zip(used, paths):
        layer.use(path, f"./coral{kind:02}.usdc")
    weed = layer.look("Weed", diffuseColor=(0.16, 0.3, 0.05), roughness=0.5)
    tufts, width = strands(rng, seat[rng.integers(0, len(seat), many(400, size, 40))], 0.35, 0.006, 6)
    layer.curves(layer.at("Weed"), tufts, width, weed)
    layer.save()


def strands(rng, roots, length: float, width: float, points: int):
    """Strands that sway together, and their widths."""
    count = len(roots)
    along = np.linspace(0, 1, points)[None, :, None]
    tall = length * rng.uniform(0.5, 1.2, (count, 1, 1))
    sway = rng.normal(size=(count, 1, 3)) * [0.3, 0.3, 0.0] + [0.25, 0.1, 0.0]
    curl = np.sin(along * 5 + rng.uniform(0, 6, (count, 1, 1))) * [0.06, 0.05, 0.0]
    made = roots[:, None] + tall * (along * [0, 0, 1.0] + along**2 * sway + along * curl)
    thin = width * rng.uniform(0.7, 1.3, (count, 1)) * (1 - 0.75 * np.linspace(0, 1, points)[None])
    return made, thin


def extent(size: float) -> float:
    """Metres from the middle to the seabed's edge: a smaller set is a smaller place as thick with life."""
    return max(30.0 * size**0.5, 5.0)


def scatter(rng, count: int, spread: float):
    """Places on the seabed, thicker around a few middles and away from the sand channel."""
    middles = rng.uniform(-spread, spread, (12, 2))
    near = middles[rng.integers(0, 12, count)] + rng.normal(size=(count, 2)) * spread * 0.1
    places = np.where(rng.random((count, 1)) < 0.6, near, rng.uniform(-spread, spread, (count, 2)))
    places = np.clip(places, -spread * 0.98, spread * 0.98)
    places[:, 0] += np.sign(places[:, 0]) * np.clip(2.0 - np.abs(places[:, 0]), 0, None)
    return np.concatenate([places, height(places[:, 0], places[:, 1])[:, None]], 1)


def write_seabed(layer: Layer, folder: pathlib.Path, rng, size: float, texture: int) -> None:
    """Catmull-Clark with displacement from a 16 bit file, its colour in four UDIM tiles."""
    for tile in range(4):
        sand = shapes.noise(rng, texture, 1, 6)
        picture(folder / f"tex/sand.{1001 + tile % 2 + 10 * (tile // 2)}.png", [0.7, 0.6, 0.42] * (0.5 + 0.5 * sand))
    picture(folder / "tex/sand_height.png", shapes.noise(rng, texture, 1, 24, 0.4), 16)
    rock = shapes.noise(rng, texture, 1, 12, 0.6)
    picture(folder / "tex/rock.png", [0.4, 0.36, 0.33] * (0.4 + 0.7 * rock))
    slope = [(np.roll(rock, 1, axis) - np.roll(rock, -1, axis))[..., 0] * texture / 40 for axis in (1, 0)]
    normal = np.stack([slope[0], -slope[1], np.ones_like(slope[0])], -1)
    picture(folder / "tex/rock_normal.png", normal / np.linalg.norm(normal, axis=2, keepdims=True) * 0.5 + 0.5)
    cells = max(int(160 * size**0.5), 32)
    reach = extent(size)
    ticks = np.linspace(-reach, reach, cells + 1)
    ground = shapes.sheet(ticks, ticks, height)
    ground = ground._replace(st=(ground.points[:, :2] / reach * 0.9995 + 1))
    ripples = layer.texture(
        "Sand", "Height", "./tex/sand_height.png", output="r", color_space="raw", wrap="repeat",
        st=shading.transform2d(
            layer.stage, layer.at("Looks/Sand/Tiled"),
            shading.primvar(layer.stage, layer.at("Looks/Sand/Reader"), "st"), (6, 6),
        ),
        scale=(25.0, 25.0, 25.0, 1.0), bias=(-12.0, -12.0, -12.0, 0.0),
    )  # fmt: skip
    sand = layer.look(
        "Sand", diffuseColor=layer.texture("Sand", "Color", "./tex/sand.<UDIM>.png"), roughness=0.95,
        displacement=ripples,
    )
    sand.CreateDisplacementOutput().ConnectToSource(
        shading.UsdShade.Shader.Get(layer.stage, f"{sand.GetPath()}/Surface").CreateOutput(
            "displacement", Sdf.ValueTypeNames.Token
        )
    )
    layer.mesh(layer.at("Seabed"), ground, sand, scheme="catmullClark")


def light(layer: Layer) -> None:
    """Blue from all sides, and a sun that the water has softened."""
    dome = UsdLux.DomeLight.Define(layer.stage, layer.at("Lights/Water"))
    dome.CreateIntensityAttr(0.5)
    dome.CreateColorAttr(Gf.Vec3f(0.08, 0.4, 0.75))
    layer.sun("Sun", 4.7, 3.0, (1.0, 0.95, 0.8), (-8, -6, 20))


def build(folder: pathlib.Path, seed: int, size: float, texture: int) -> pathlib.Path:
    rng = np.random.default_rng([0x7EEF, seed])
    kinds, colonies = many(18, size**0.5, 6), many(8, size**0.5, 3)
    write_corals(folder, rng, size, texture, kinds)
    layer = Layer(folder / "reef.usda", "Reef", *AXIS, kind="assembly")
    write_seabed(layer, folder, rng, size, texture)
    for number in range(colonies):
        write_colony(folder, rng, size, number, kinds)
    places = scatter(rng, many(4000, size, 60), extent(size))
    groups = [layer.at(f"Colonies/Colony{number}") for number in range(colonies)]
    layer.instancer(
        layer.at("Colonies"), groups, rng.integers(0, colonies, len(places)), places,
        shapes.turns(rng, len(places), 0.1), rng.lognormal(-0.7, 0.4, len(places)),
    )
    for number, path in enumerate(groups):
        layer.use(path, f"./colony{number}.usdc", payload=True)
    write_plants(layer, rng, size)
    light(layer)
    eye = -0.7 * extent(size)
    layer.camera((1.0, eye, float(height(1.0, eye)) + 1.1), (0.3, eye + 6.0, 0.4), focal=24.0, near=0.05, far=200.0)
    layer.save()
    return layer.path


def write_plants(layer: Layer, rng, size: float) -> None:
    """Kelp and grass as curves of the scene's own, and points: grains on the ground, bubbles above it."""
    reach = extent(size)
    kelp = layer.look("Kelp", diffuseColor=(0.2, 0.22, 0.04), roughness=0.35)
    layer.curves(layer.at("Kelp"), *strands(rng, scatter(rng, many(3000, size, 60), reach), 3.5, 0.05, 12), kelp)
    grass = layer.look("Grass", diffuseColor=(0.08, 0.3, 0.08), roughness=0.5)
    meadow = scatter(rng, many(400000, size, 2000), reach)
    layer.curves(layer.at("Grass"), *strands(rng, meadow, 0.25, 0.008, 5), grass, "catmullRom")
    grains = rng.uniform(-reach, reach, (many(600000, size, 3000), 2)) * [0.3, 1.0]
    grains = np.concatenate([grains, height(grains[:, 0], grains[:, 1])[:, None] + 0.01], 1)
    shell = layer.look("Shell", diffuseColor=(0.8, 0.7, 0.6), roughness=0.3)
    dots = layer.dots(layer.at("Grains"), grains, rng.uniform(0.004, 0.025, len(grains)), shell)
    tint = np.array([0.8, 0.7, 0.6]) * rng.uniform(0.5, 1.2, (len(grains), 1))
    dots.CreateDisplayColorPrimvar("vertex").Set(Vt.Vec3fArray.FromNumpy(tint.astype(np.float32)))
    water = layer.look("Bubble", diffuseColor=(0.9, 0.95, 1.0), opacity=0.25, ior=1.1, roughness=0.02)
    stems = scatter(rng, 40, reach * 0.6)[rng.integers(0, 40, many(20000, size, 300))]
    rise = rng.random((len(stems), 1))
    bubbles = stems + rng.normal(size=stems.shape) * 0.12 * (0.3 + rise) + rise * [0, 0, 4.0]
    layer.dots(layer.at("Bubbles"), bubbles, rng.uniform(0.01, 0.06, len(bubbles)), water)


if __name__ == "__main__":
    run("reef", build, 2048)
