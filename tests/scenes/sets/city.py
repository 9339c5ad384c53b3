# SPDX-License-Identifier: Apache-2.0
"""A city at dusk in metres, z up: each building a file with pictures of its own, its windows a point instancer inside
of it; blocks, streets with instanced lamps and cars, a ground of UDIMs.

    python -m sets.city FOLDER [--seed N] [--size S] [--texture N]

Even seeds are for tuning, odd seeds are held out (see the package).
"""

from __future__ import annotations

import pathlib

import numpy as np
from pxr import Gf, UsdLux

import shading
from . import shapes
from .layer import Layer, picture, run

AXIS = ("Z", 1.0)
BLOCK, STREET = 60.0, 16.0
STORY = 3.4


def facade(rng, texture: int) -> np.ndarray:
    """Plaster or brick with stains that run down; one story high and wide."""
    base = np.array([rng.uniform(0.35, 0.75), rng.uniform(0.3, 0.6), rng.uniform(0.25, 0.5)])
    rows = np.arange(texture)[:, None] * 24 // texture
    columns = (np.arange(texture)[None] * 12 // texture + (rows % 2) * 0.5).astype(int)
    bricks = rng.uniform(0.75, 1.1, (24, 14))[rows, columns][..., None]
    stains = shapes.noise(rng, texture, 1, 5)
    return base * bricks * (0.6 + 0.5 * stains)


def write_building(folder: pathlib.Path, rng, number: int, texture: int) -> tuple[str, float]:
    """One building: its file, and how tall it is."""
    name = f"b{number:05}"
    picture(folder / f"buildings/{name}/facade.png", facade(rng, texture))
    rough = 0.45 + 0.5 * shapes.noise(rng, max(texture // 2, 4))
    picture(folder / f"buildings/{name}/rough.png", rough, 16)
    layer = Layer(folder / f"buildings/{name}/{name}.usdc", "Building", *AXIS)
    wall = layer.look(
        "Wall", diffuseColor=layer.texture("Wall", "Color", "./facade.png"),
        roughness=layer.texture("Wall", "Rough", "./rough.png", output="r", color_space="raw"),
    )
    stories = int(np.clip(rng.lognormal(1.9, 0.6), 3, 60))
    wide, deep = rng.uniform(9, 13, 2)
    parts, windows, floor = [], [], 0
    while stories - floor > 0:
        here = stories - floor if len(parts) == 2 else max((stories - floor) * 2 // 3, 1)
        part = shapes.box(wide, deep, here * STORY)
        parts.append(shapes.moved(part, (0, 0, floor * STORY)))
        windows.append(openings(wide, deep, floor, here))
        floor, wide, deep = floor + here, wide * 0.78, deep * 0.78
    shell = shapes.joined(parts)
    layer.mesh(layer.at("Shell"), shell, wall, st_scale=1 / STORY)
    variants = layer.stage.GetDefaultPrim().GetVariantSets().AddVariantSet("windows")
    for variant in ("none", "full"):
        variants.AddVariant(variant)
        variants.SetVariantSelection(variant)
        if variant == "full":
            with variants.GetVariantEditContext():
                write_windows(layer, rng, np.concatenate(windows))
    layer.save()
    return f"./buildings/{name}/{name}.usdc", stories * STORY


def openings(wide: float, deep: float, floor: int, count: int) -> np.ndarray:
    """Places of the windows of a part, and the angle that they face: (n, 4)."""
    made = []
    for side, (length, away) in enumerate([(wide, deep), (deep, wide), (wide, deep), (deep, wide)]):
        across = np.arange(-length / 2 + 1.4, length / 2 - 1.2, 2.6)
        x, z = np.meshgrid(across, (floor + np.arange(count)) * STORY + 1.0)
        angle = side * np.pi / 2
        flat = np.stack([x.ravel(), np.full(x.size, -away / 2 - 0.02), z.ravel()], -1)
        turned = np.stack([
            flat[:, 0] * np.cos(angle) - flat[:, 1] * np.sin(angle),
            flat[:, 0] * np.sin(angle) + flat[:, 1] * np.cos(angle), flat[:, 2], np.full(x.size, angle),
        ], -1)  # fmt: skip
        made.append(turned)
    return np.concatenate(made)


def write_windows(layer: Layer, rng, windows: np.ndarray) -> None:
    """Every window is one of three kinds: dark, lit, with a balcony."""
    angle = windows[:, 3] / 2
    turn = np.stack([np.cos(angle), 0 * angle, 0 * angle, np.sin(angle)], -1)
    kinds = rng.choice(3, len(windows), p=[0.6, 0.25, 0.15])
    names = ["Dark", "Lit", "Balcony"]
    paths = [layer.at(f"Windows/{name}") for name in names]
    layer.instancer(layer.at("Windows"), paths, kinds, windows[:, :3], turn)
    for name, path in zip(names, paths):
        layer.use(path, f"../../parts/{name.lower()}.usdc")


def write_parts(folder: pathlib.Path, rng, texture: int) -> None:
    """Windows, a lamp and a car: what is instanced."""
    curtain = np.array([1.0, 0.72, 0.4]) * (0.35 + 0.65 * shapes.noise(rng, max(texture // 2, 4), 1, 3))
    picture(folder / "parts/curtain.png", curtain)
    for name in ("Dark", "Lit", "Balcony"):
        layer = Layer(folder / f"parts/{name.lower()}.usdc", name, *AXIS)
        frame = layer.look("Frame", diffuseColor=(0.75, 0.75, 0.72), roughness=0.5)
        pane = layer.look("Pane", diffuseColor=(0.02, 0.03, 0.04), roughness=0.03, specularColor=(1.0, 1.0, 1.0))
        if name == "Lit":
            glow = layer.texture("Pane", "Curtain", "./curtain.png", scale=(1.8, 1.8, 1.8, 1.0))
            pane = layer.look("Pane", diffuseColor=(0.0, 0.0, 0.0), roughness=0.2, emissiveColor=glow)
        bars = [((0, 0, 0), (1.3, 0.12, 0.08)), ((0, 0, 1.52), (1.3, 0.12, 0.08))]
        bars += [((x, 0, 0.08), (0.06, 0.12, 1.44)) for x in (-0.62, 0, 0.62)]
        layer.mesh(
            layer.at("Frame"), shapes.joined([shapes.moved(shapes.box(*size), at) for at, size in bars]), frame
        )
        layer.mesh(layer.at("Pane"), shapes.moved(shapes.card(1.24, 1.44), (0, -0.01, 0.08)), pane)
        if name == "Balcony":
            rails = [shapes.moved(shapes.box(0.03, 0.03, 0.9), (x, -0.9, 0)) for x in np.linspace(-1, 1, 15)]
            rails += [shapes.moved(shapes.box(2.1, 1.0, 0.1), (0, -0.5, -0.1))]
            rails += [shapes.moved(shapes.box(2.1, 0.06, 0.06), (0, -0.9, 0.9))]
            layer.mesh(layer.at("Rail"), shapes.joined(rails), frame)
        layer.save()
    write_lamp(folder)
    write_car(folder)


def write_lamp(folder: pathlib.Path) -> None:
    layer = Layer(folder / "parts/lamp.usdc", "Lamp", *AXIS)
    iron = layer.look("Iron", diffuseColor=(0.05, 0.05, 0.055), metallic=0.6, roughness=0.4)
    line = np.array([[0, 0, 0], [0, 0, 3], [0, 0, 5.5], [0, -0.3, 5.9], [0, -1.0, 6.0]], float)
    layer.mesh(layer.at("Post"), shapes.tube(line, np.array([0.09, 0.07, 0.05, 0.05, 0.05]), 12), iron)
    bulb = layer.look("Bulb", diffuseColor=(0.0, 0.0, 0.0), emissiveColor=(40.0, 26.0, 12.0))
    arc = np.linspace(-np.pi / 2, np.pi / 2, 9)
    ball = shapes.lathe(np.stack([0.14 * np.cos(arc), 0.14 * np.sin(arc)], -1), 16)
    layer.mesh(layer.at("Bulb"), shapes.moved(ball, (0, -1.0, 5.8)), bulb)
    layer.save()


def write_car(folder: pathlib.Path) -> None:
    """A subdivided body in three variants of paint, glass that lets light through, wheels as instances of a file."""
    wheel = Layer(folder / "parts/wheel.usdc", "Wheel", *AXIS)
    rubber = wheel.look("Rubber", diffuseColor=(0.03, 0.03, 0.03), roughness=0.8)
    ring = np.array([[0.18, -0.1], [0.31, -0.1], [0.33, -0.06], [0.33, 0.06], [0.31, 0.1], [0.18, 0.1], [0.18, -0.1]])
    shape = shapes.lathe(ring, 40)
    wheel.mesh(wheel.at("Tyre"), shape._replace(points=shape.points[:, [0, 2, 1]] * [1, -1, 1]), rubber, double=True)
    wheel.save()
    layer = Layer(folder / "parts/car.usdc", "Car", *AXIS)
    body = shapes.joined([
        shapes.moved(shapes.box(4.3, 1.75, 0.65), (0, 0, 0.3)), shapes.moved(shapes.box(2.2, 1.5, 0.12), (-0.2, 0, 1.4))
    ])  # fmt: skip
    mesh = layer.mesh(layer.at("Body"), body)
    glass = layer.look("Glass", diffuseColor=(0.9, 0.95, 0.95), opacity=0.15, ior=1.5, roughness=0.01)
    layer.mesh(layer.at("Cabin"), shapes.moved(shapes.box(2.3, 1.55, 0.5), (-0.2, 0, 0.92)), glass)
    for number, (x, y) in enumerate([(-1.4, -0.8), (1.4, -0.8), (-1.4, 0.8), (1.4, 0.8)]):
        layer.use(layer.at(f"Wheel{number}"), "./wheel.usdc", instance=True, place=(x, y, 0.33))
    paints = {"red": (0.5, 0.03, 0.02), "white": (0.75, 0.75, 0.73), "blue": (0.03, 0.07, 0.35)}
    variants = layer.stage.GetDefaultPrim().GetVariantSets().AddVariantSet("paint")
    for name, color in paints.items():
        look = layer.look(name.capitalize(), diffuseColor=color, roughness=0.3, clearcoat=1.0, clearcoatRoughness=0.03)
        variants.AddVariant(name)
        variants.SetVariantSelection(name)
        with variants.GetVariantEditContext():
            shading.bind(mesh, look)
    layer.save()


def write_ground(layer: Layer, folder: pathlib.Path, rng, blocks: int, texture: int) -> None:
    """Asphalt and pavements painted over 2 x 2 tiles that cover the city."""
    pitch = BLOCK + STREET
    reach = blocks * pitch / 2 + STREET
    whole = np.linspace(-reach, reach, 2 * texture, endpoint=False)
    inside = np.abs((whole + blocks * pitch / 2) % pitch - pitch / 2) < BLOCK / 2
    middle = np.abs((whole + blocks * pitch / 2 + pitch / 2) % pitch - pitch / 2) < 0.12
    block = inside[:, None] & inside[None]
    line = (middle[:, None] & ~inside[None]) | (middle[None] & ~inside[:, None])
    for tile in range(4):
        rows = slice((tile // 2) * texture, (tile // 2 + 1) * texture)
        columns = slice((tile % 2) * texture, (tile % 2 + 1) * texture)
        grain = 0.7 + 0.5 * shapes.noise(rng, texture, 1, 16, 0.75)
        color = np.where(block[rows, columns, None], 0.42, 0.16) * grain
        color = np.where(line[rows, columns, None], 0.8, color)
        # Row 0 of a file is its top, where t is 1.
        picture(folder / f"tex/ground.{1001 + tile % 2 + 10 * (tile // 2)}.png", np.repeat(color[::-1], 3, 2))
    ticks = np.linspace(-reach, reach, 9)
    ground = shapes.sheet(ticks, ticks, lambda x, y: 0 * x)
    ground = ground._replace(st=(ground.points[:, :2] / reach + 1) * 0.99999)
    look = layer.look("Ground", diffuseColor=layer.texture("Ground", "Color", "./tex/ground.<UDIM>.png"), roughness=0.7)
    layer.mesh(layer.at("Ground"), ground, look)


def build(folder: pathlib.Path, seed: int, size: float, texture: int) -> pathlib.Path:
    rng = np.random.default_rng([0xC117, seed])
    write_parts(folder, rng, texture)
    layer = Layer(folder / "city.usda", "City", *AXIS, kind="assembly")
    blocks = max(round((1000 * size / 12) ** 0.5), 2)
    pitch = BLOCK + STREET
    write_ground(layer, folder, rng, blocks, max(texture * 2, 8))
    number = 0
    for row in range(blocks):
        for column in range(blocks):
            middle = (np.array([column, row]) + 0.5 - blocks / 2) * pitch
            path = layer.at(f"Blocks/Block_{column}_{row}")
            layer.xform(path, (*middle, 0), kind="group")
            for lot in lots():
                file, _ = write_building(folder, rng, number, texture)
                placed = layer.use(
                    f"{path}/Building_{number}", file, payload=True, place=(*lot, 0), degrees=90.0 * rng.integers(4)
                )
                if np.hypot(*middle) > 900:
                    placed.GetPrim().GetVariantSets().SetSelection("windows", "none")
                number += 1
    write_streets(layer, rng, blocks, pitch)
    light(layer)
    reach = blocks * pitch / 2
    layer.camera((-pitch / 2 * (blocks % 2) + 3.0, -reach - 6, 24.0), (8.0, 0, 14.0), focal=22.0, near=0.5, far=20000.0)
    layer.save()
    return layer.path


def lots() -> list[tuple[float, float]]:
    """Twelve places around the edge of a block."""
    ticks = np.linspace(-22.5, 22.5, 4)
    return [(x, y) for x in ticks for y in ticks if abs(x) > 10 or abs(y) > 10]


def write_streets(layer: Layer, rng, blocks: int, pitch: float) -> None:
    """Lamps along the pavements, cars in the lanes."""
    reach = blocks * pitch / 2
    lines = np.arange(blocks + 1) * pitch - reach
    along = np.arange(-reach, reach, 24.0)
    lamps = np.array([(line + side * 7.4, at, 0.0) for line in lines for at in along for side in (-1, 1)])
    angle = np.where(np.arange(len(lamps)) % 2, -np.pi / 2, np.pi / 2) / 2
    turn = np.stack([np.cos(angle), 0 * angle, 0 * angle, np.sin(angle)], -1)
    layer.instancer(layer.at("Lamps"), [layer.at("Lamps/Lamp")], np.zeros(len(lamps)), lamps, turn)
    layer.use(layer.at("Lamps/Lamp"), "./parts/lamp.usdc")
    cars = []
    for line in lines:
        for lane in (-2.2, 2.2):
            spots = np.arange(-reach, reach, 9.0) + rng.uniform(-2, 2)
            cars += [(line + lane, at, lane < 0) for at in spots[rng.random(len(spots)) < 0.45]]
    cars = np.array(cars, float).reshape(-1, 3)
    turn = np.where(cars[:, 2] > 0, -np.pi / 2, np.pi / 2) / 2
    turn = np.stack([np.cos(turn), 0 * turn, 0 * turn, np.sin(turn)], -1)
    names = ["red", "white", "blue"]
    paths = [layer.at(f"Cars/{name.capitalize()}") for name in names]
    places = np.concatenate([cars[:, :2], 0 * cars[:, :1]], 1)
    layer.instancer(layer.at("Cars"), paths, rng.integers(0, 3, len(cars)), places, turn)
    for name, path in zip(names, paths):
        layer.use(path, "./parts/car.usdc").GetPrim().GetVariantSets().SetSelection("paint", name)


def light(layer: Layer) -> None:
    """The sky after sunset, and a low sun between the houses."""
    sky = UsdLux.DomeLight.Define(layer.stage, layer.at("Lights/Sky"))
    sky.CreateIntensityAttr(0.35)
    sky.CreateColorAttr(Gf.Vec3f(0.45, 0.55, 0.9))
    layer.sun("Sun", 2.2, 1.5, (1.0, 0.55, 0.3), (-30, -22, 14))


if __name__ == "__main__":
    run("city", build, 512)
