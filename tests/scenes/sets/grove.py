# SPDX-License-Identifier: Apache-2.0
"""A grove in wind in decimetres, y up, with motion blur at frame 12: trees that sway whole, trees whose points move,
leaf cards cut out by textures in nested instances, grass as curves that bend. The camera moves and its shutter is open.

    python -m sets.grove FOLDER [--seed N] [--size S] [--texture N]

Render it with `--frames 12`. Even seeds are for tuning, odd seeds are held out (see the package).
"""

from __future__ import annotations

import pathlib

import numpy as np
from pxr import Gf, UsdLux, UsdShade, Vt

from . import shapes
from .layer import Layer, many, picture, run

AXIS = ("Y", 0.1)
FRAME = 12
TIMES = (FRAME - 1, FRAME, FRAME + 1)
LEAVES = 3


def extent(size: float) -> float:
    """Metres from the middle to the edge of the ground: a smaller set is a smaller place as thick with trees."""
    return max(160.0 * size**0.5, 30.0)


def height(x, y):
    return 1.6 * np.sin(x * 0.05) * np.cos(y * 0.043 + 1.0) + 0.25 * np.sin(x * 0.31 + 0.2 * y)


def gust(x, y, time):
    """How far the wind bends at a place and a time, about -1 to 1."""
    return 0.6 * np.sin(0.9 * time + 0.13 * x + 0.07 * y) + 0.4 * np.sin(2.1 * time + 0.31 * y)


def write_pictures(folder: pathlib.Path, rng, texture: int) -> None:
    """Leaves with their outline in alpha, bark with a 16 bit height, a ground of four UDIM tiles."""
    small = max(texture // 2, 8)
    y, x = np.mgrid[1:-1:small * 1j, -1:1:small * 1j]
    for kind in range(LEAVES):
        angle, radius = np.arctan2(x, y), np.hypot(x * (1.3 + 0.4 * kind), y)
        lobes = 0.8 + 0.17 * np.cos((3 + 2 * kind) * angle) + 0.04 * np.cos(31 * angle)
        vein = 0.75 + 0.25 * np.minimum(np.abs(x) * 9, 1)[..., None]
        color = np.array([0.18 + 0.12 * kind, 0.42, 0.07]) * vein * (0.6 + 0.6 * shapes.noise(rng, small, 1, 6))
        alpha = np.clip((lobes - radius) * small / 6 + 0.5, 0, 1)[..., None]
        picture(folder / f"tex/leaf{kind}.png", np.concatenate([color, alpha], 2))
    bark = shapes.noise(rng, texture, 1, 24, 0.7)
    picture(folder / "tex/bark.png", [0.34, 0.25, 0.18] * (0.3 + 0.9 * bark))
    picture(folder / "tex/bark_rough.png", 0.6 + 0.4 * bark, 16)
    for tile in range(4):
        soil, moss = shapes.noise(rng, texture, 1, 8), shapes.noise(rng, texture, 1, 3)
        color = np.where(moss > 0.5, [0.16, 0.24, 0.06], [0.3, 0.22, 0.14]) * (0.5 + 0.8 * soil)
        picture(folder / f"tex/ground.{1001 + tile % 2 + 10 * (tile // 2)}.png", color)


def looks(layer: Layer, tex: str) -> tuple[UsdShade.Material, list[UsdShade.Material]]:
    """Bark, and leaves cut out at thresholds that differ."""
    bark = layer.look(
        "Bark", diffuseColor=layer.texture("Bark", "Color", f"{tex}/bark.png"),
        roughness=layer.texture("Bark", "Rough", f"{tex}/bark_rough.png", output="r", color_space="raw"),
    )
    leaves = []
    for kind in range(LEAVES):
        name = f"Leaf{kind}"
        color = layer.texture(name, "Picture", f"{tex}/leaf{kind}.png")
        cut = layer.texture(name, "Picture", f"{tex}/leaf{kind}.png", output="a")
        edge = 0.3 + 0.1 * kind
        leaves.append(layer.look(name, diffuseColor=color, opacity=cut, opacityThreshold=edge, roughness=0.5))
    return bark, leaves


def tree(rng, leaves: int):
    """The wood as one shape; places, turns, sizes and kinds of leaves."""
    tall = rng.uniform(6, 11)
    steps = np.linspace(0, 1, 16)
    trunk = np.stack([0.3 * np.sin(steps * 3 + rng.uniform(0, 6)), 0.3 * np.sin(steps * 4), steps * tall], -1)
    trunk -= trunk[0]
    wood, ends = [shapes.tube(trunk, 0.022 * tall * (1.05 - steps), 20)], []
    for _ in range(22):
        at = rng.integers(5, 15)
        angle, rise = rng.uniform(0, shapes.TAU), rng.uniform(0.2, 0.8)
        length = tall * 0.38 * (1.2 - steps[at])
        bend = np.linspace(0, 1, 9)[:, None]
        way = np.array([np.cos(angle), np.sin(angle), rise])
        line = trunk[at] + length * (bend * way + bend**2 * [0, 0, rng.uniform(-0.2, 0.4)])
        wood.append(shapes.tube(line, 0.008 * tall * (1.1 - bend[:, 0]), 9))
        ends.append(line[3:])
    ends = np.concatenate(ends)
    places = ends[rng.integers(0, len(ends), leaves)] + rng.normal(size=(leaves, 3)) * 0.045 * tall
    return shapes.joined(wood), places, shapes.any_turns(rng, leaves), rng.uniform(0.5, 1.4, leaves)


def write_tree(folder: pathlib.Path, rng, number: int, size: float) -> None:
    """A tree for instances: its leaves are a point instancer of three cards."""
    layer = Layer(folder / f"tree{number}.usdc", "Tree", *AXIS)
    bark, leaf = looks(layer, "./tex")
    wood, places, turn, scale = tree(rng, many(9000, size**0.5, 400))
    layer.smooth(layer.mesh(layer.at("Wood"), wood, bark), wood)
    cards = [layer.at(f"Leaves/Card{kind}") for kind in range(LEAVES)]
    layer.instancer(layer.at("Leaves"), cards, rng.integers(0, LEAVES, len(places)), places, turn, scale)
    for kind, path in enumerate(cards):
        layer.mesh(path, shapes.card(0.22, 0.3), leaf[kind], double=True)
    layer.save()


def write_hero(folder: pathlib.Path, rng, number: int, size: float) -> None:
    """A tree whose points move: simulated, so wood and leaves are meshes with samples."""
    layer = Layer(folder / f"hero{number}.usdc", "Hero", *AXIS)
    span(layer)
    bark, leaf = looks(layer, "./tex")
    wood, places, turn, scale = tree(rng, many(9000, size**0.5, 400))
    bend = lambda points, time: points + _bend(points[:, 2:3], gust(3.0 * number, points[:, :1] * 3, time))
    layer.samples(layer.mesh(layer.at("Wood"), wood, bark), {time: bend(wood.points, time) for time in TIMES})
    card = shapes.card(0.22, 0.3)
    corners = np.einsum("nij,kj->nki", shapes.rotation(turn), card.points) * scale[:, None, None]
    kinds = rng.integers(0, LEAVES, len(places))
    for kind in range(LEAVES):
        own = kinds == kind
        count = int(own.sum())
        points = (corners[own] + places[own][:, None]).reshape(-1, 3)
        faces = np.arange(4 * count).reshape(-1, 4)
        mesh = layer.mesh(
            layer.at(f"Leaves{kind}"), shapes.Shape(points, faces, np.tile(card.st, (count, 1))), leaf[kind],
            double=True,
        )  # fmt: skip
        flutter = np.repeat(rng.uniform(0, 6, (count, 1)), 4, 0)
        shaken = lambda time: 0.03 * np.sin(3.0 * time + flutter) * (points * 0 + [1.0, 0.4, 0.7])
        layer.samples(mesh, {time: bend(points, time) + shaken(time) for time in TIMES})
    layer.save()


def _bend(tall, wind):
    """The wind blows along x, more the higher up."""
    return (tall / 8.0) ** 2 * wind * [0.55, 0.1, 0.0]


def span(layer: Layer) -> None:
    layer.stage.SetTimeCodesPerSecond(24)
    layer.stage.SetFramesPerSecond(24)
    layer.stage.SetStartTimeCode(TIMES[0])
    layer.stage.SetEndTimeCode(TIMES[-1])


def scatter(rng, count: int, reach: float, clearing: float = 0.0):
    """Places on the ground, off a path along y."""
    places = rng.uniform(-reach, reach, (count, 2)) * 0.97
    side = np.sign(places[:, 0]) * clearing
    places[:, 0] = side + places[:, 0] * (1 - clearing / reach)
    return np.concatenate([places, height(places[:, 0], places[:, 1])[:, None]], 1)


def write_wood(layer: Layer, rng, size: float, trees: int, heroes: int) -> None:
    """Trees by a point instancer whose turns have samples, trees that rotate as native instances, and simulated
    ones."""
    reach = extent(size)
    places = scatter(rng, many(6000, size, 60), reach, 4.0)
    paths = [layer.at(f"Wood/Tree{number}") for number in range(trees)]
    rest = shapes.turns(rng, len(places), 0.03)
    made = layer.instancer(
        layer.at("Wood"), paths, rng.integers(0, trees, len(places)), places, rest, rng.uniform(0.6, 1.3, len(places))
    )
    for time in TIMES:
        lean = 0.02 * gust(places[:, 0], places[:, 1], time)
        swayed = rest + lean[:, None] * np.stack([0 * lean, 0 * lean, 1 + 0 * lean, 0 * lean], -1)
        swayed /= np.linalg.norm(swayed, axis=1, keepdims=True)
        packed = np.concatenate([layer.turned(swayed[:, 1:]), swayed[:, :1]], 1)
        made.GetOrientationsAttr().Set(Vt.QuathArray.FromNumpy(np.ascontiguousarray(packed, np.float16)), time)
    for number, path in enumerate(paths):
        layer.use(path, f"./tree{number}.usdc")
    places = scatter(rng, many(300, size, 12), reach * 0.6, 3.5)
    for number, place in enumerate(places):
        path = layer.at(f"Swaying/Tree_{number}")
        swaying = layer.use(
            path, f"./tree{rng.integers(trees)}.usdc", payload=True, instance=True, place=place,
            degrees=rng.uniform(0, 360), scale=rng.uniform(0.6, 1.1),
        )
        lean = swaying.AddRotateXOp()
        lean.Set(0.0)
        for time in TIMES:
            lean.Set(float(2.0 * gust(place[0], place[1], time)), time)
    for number in range(heroes):
        place = np.array([(-1) ** number * rng.uniform(3.6, 6.0), -0.8 * reach + 9.0 + 5.0 * number, 0.0])
        place[2] = height(place[0], place[1])
        layer.use(layer.at(f"Heroes/Hero_{number}"), f"./hero{number}.usdc", payload=True, place=place)


def write_grass(layer: Layer, rng, size: float) -> None:
    """Blades about the path, each with a bend of its own and samples of the wind."""
    reach = extent(size)
    roots = scatter(rng, many(300000, size, 6000), reach * 0.8)
    along = np.linspace(0, 1, 4)[None, :, None]
    tall = rng.uniform(0.15, 0.5, (len(roots), 1, 1))
    lean = rng.normal(size=(len(roots), 1, 3)) * [0.4, 0.4, 0.0]

    def blades(time):
        wind = gust(roots[:, 0], roots[:, 1], time)[:, None, None] * [0.35, 0.06, 0.0]
        return roots[:, None] + tall * (along * [0, 0, 1.0] + along**2 * (lean + wind))

    widths = 0.012 * (1 - 0.8 * along[..., 0]) * np.ones((len(roots), 1))
    green = layer.look("Grass", diffuseColor=(0.16, 0.34, 0.06), roughness=0.6)
    curves = layer.curves(layer.at("Grass"), blades(FRAME), widths, green)
    layer.samples(curves, {time: blades(time).reshape(-1, 3) for time in TIMES})


def write_ground(layer: Layer, size: float) -> None:
    reach = extent(size)
    ticks = np.linspace(-reach, reach, max(int(200 * size**0.5), 40) + 1)
    ground = shapes.sheet(ticks, ticks, height)
    ground = ground._replace(st=(ground.points[:, :2] / reach * 0.9999 + 1))
    look = layer.look("Ground", diffuseColor=layer.texture("Ground", "Color", "./tex/ground.<UDIM>.png"), roughness=0.9)
    layer.smooth(layer.mesh(layer.at("Ground"), ground, look), ground)


def write_camera(layer: Layer, size: float) -> None:
    """Walks along the path; the shutter is open for half a frame."""
    eye = -0.8 * extent(size)
    target = (0.6, eye + 20.0, float(height(0.6, eye + 20.0)) + 3.2)
    camera = layer.camera((0.0, eye, float(height(0.0, eye)) + 1.7), target, focal=26.0, near=0.05, far=2000.0)
    camera.CreateShutterOpenAttr(-0.25)
    camera.CreateShutterCloseAttr(0.25)
    op = camera.GetOrderedXformOps()[0]
    rest = op.Get()
    for time in TIMES:
        step = layer.lengths((0.0, 0.06 * (time - FRAME), 0.01 * (time - FRAME)))
        op.Set(rest * Gf.Matrix4d().SetTranslate(Gf.Vec3d(*map(float, step))), time)


def build(folder: pathlib.Path, seed: int, size: float, texture: int) -> pathlib.Path:
    rng = np.random.default_rng([0x62, seed])
    write_pictures(folder, rng, texture)
    trees, heroes = many(8, size**0.5, 3), many(6, size**0.5, 2)
    for number in range(trees):
        write_tree(folder, rng, number, size)
    for number in range(heroes):
        write_hero(folder, rng, number, size)
    layer = Layer(folder / "grove.usda", "Grove", *AXIS, kind="assembly")
    span(layer)
    write_ground(layer, size)
    write_wood(layer, rng, size, trees, heroes)
    write_grass(layer, rng, size)
    sky = UsdLux.DomeLight.Define(layer.stage, layer.at("Lights/Sky"))
    sky.CreateIntensityAttr(1.2)
    sky.CreateColorAttr(Gf.Vec3f(0.6, 0.75, 1.0))
    layer.sun("Sun", 6.0, 0.53, (1.0, 0.9, 0.75), (-14, -10, 16))
    write_camera(layer, size)
    layer.save()
    return layer.path


if __name__ == "__main__":
    run("grove", build, 1024)
