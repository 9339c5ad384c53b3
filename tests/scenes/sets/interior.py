# SPDX-License-Identifier: Apache-2.0
"""A room in centimetres, y up: shelves and tables full of props of very different weight, UsdPreviewSurface and
MaterialX side by side, and lights of every form with a bright window.

    python -m sets.interior FOLDER [--seed N] [--size S] [--texture N]

Even seeds are for tuning, odd seeds are held out (see the package).
"""

from __future__ import annotations

import pathlib

import numpy as np
from pxr import Gf, Sdf, UsdLux, UsdShade

import images
from . import shapes
from .layer import Layer, many, picture, run

AXIS = ("Y", 0.01)
WIDE, DEEP, TALL = 6.0, 5.0, 2.9
SHELVES = 6
COLOR, FLOAT, TOKEN = Sdf.ValueTypeNames.Color3f, Sdf.ValueTypeNames.Float, Sdf.ValueTypeNames.Token


def node(layer: Layer, path: str, kind: str, **inputs) -> UsdShade.Shader:
    """A MaterialX node; an input is (type, value), the value a number, a colour, a file or another node."""
    made = UsdShade.Shader.Define(layer.stage, path)
    made.CreateIdAttr(kind)
    for name, (value_type, value) in inputs.items():
        port = made.CreateInput(name, value_type)
        if isinstance(value, UsdShade.Shader):
            port.ConnectToSource(value.CreateOutput("out", value_type))
        else:
            port.Set(Gf.Vec3f(*value) if isinstance(value, tuple) else value)
    return made


def mtlx(layer: Layer, name: str, **inputs) -> UsdShade.Material:
    """A MaterialX standard_surface below Looks."""
    path = layer.at(f"Looks/{name}")
    made = UsdShade.Material.Define(layer.stage, path)
    surface = node(layer, f"{path}/Standard", "ND_standard_surface_surfaceshader", **inputs)
    made.CreateSurfaceOutput("mtlx").ConnectToSource(surface.CreateOutput("out", TOKEN))
    return made


def glaze(layer: Layer, rng, name: str) -> UsdShade.Material:
    """Pottery: a fractal between two colours under a coat."""
    path = layer.at(f"Looks/{name}")
    UsdShade.Material.Define(layer.stage, path)
    spots = node(
        layer, f"{path}/Spots", "ND_fractal3d_float", octaves=(Sdf.ValueTypeNames.Int, 4), amplitude=(FLOAT, 0.8)
    )
    low, high = (tuple(map(float, rng.uniform(0.1, 0.8, 3))) for _ in range(2))
    mixed = node(layer, f"{path}/Mixed", "ND_mix_color3", fg=(COLOR, low), bg=(COLOR, high), mix=(FLOAT, spots))
    return mtlx(
        layer, name, base_color=(COLOR, mixed), base=(FLOAT, 0.9), specular_roughness=(FLOAT, 0.35),
        coat=(FLOAT, 0.8), coat_roughness=(FLOAT, 0.05),
    )  # fmt: skip


def book(layer: Layer, rng, number: int, folder: pathlib.Path, texture: int) -> None:
    """A cover with a picture of its own, and pages; six faces each."""
    size = max(texture // 4, 4)
    title = np.ones((size, size, 3)) * rng.uniform(0.08, 0.7, 3) * (0.85 + 0.3 * shapes.noise(rng, size, 1, 6))
    for line in range(3):
        row = int(size * (0.2 + 0.12 * line))
        title[row : row + max(size // 24, 1), size // 5 : size - size // 5 - line * size // 9] = 0.9
    picture(folder / f"tex/book{number:03}.png", title)
    tall, thick = rng.uniform(0.18, 0.3), rng.uniform(0.015, 0.05)
    printed = layer.texture("Cover", "Title", f"./tex/book{number:03}.png")
    cover = layer.look("Cover", diffuseColor=printed, roughness=0.5)
    paper = layer.look("Paper", diffuseColor=(0.8, 0.76, 0.66), roughness=0.95)
    boards = [shapes.moved(shapes.box(0.003, 0.15, tall), (x, 0, 0)) for x in (-thick / 2, thick / 2)]
    boards.append(shapes.moved(shapes.box(thick, 0.003, tall), (0, -0.075, 0)))
    layer.mesh(layer.at("Cover"), shapes.joined(boards), cover, st_scale=4.0)
    layer.mesh(layer.at("Pages"), shapes.moved(shapes.box(thick * 0.9, 0.14, tall * 0.97), (0, 0, tall * 0.01)), paper)


def pot(layer: Layer, rng, number: int, folder: pathlib.Path, texture: int) -> None:
    """A vase: a lathe of subdivided quads in a MaterialX glaze."""
    z = np.linspace(0, rng.uniform(0.15, 0.35), 14)
    r = 0.05 + 0.03 * np.sin(z * rng.uniform(14, 30) + rng.uniform(0, 6)) + 0.02 * rng.random()
    outside = np.stack([r, z], -1)
    profile = np.concatenate([[[0.0, 0.0]], outside, outside[::-1] * [0.93, 1.0] + [0, 0.004], [[0.0, 0.01]]])
    layer.mesh(layer.at("Body"), shapes.lathe(profile, 32), glaze(layer, rng, "Glaze"), scheme="catmullClark")


def bottle(layer: Layer, rng, number: int, folder: pathlib.Path, texture: int) -> None:
    """Glass with a wall that has two sides."""
    tall = rng.uniform(0.2, 0.32)
    outside = np.array([[0.0, 0.0], [0.036, 0.0], [0.038, 0.01], [0.038, 0.6], [0.013, 0.78], [0.013, 1.0]]) * [1, tall]
    inside = np.maximum(outside[::-1] - [0.004, 0.0], 0) + [0, 0.006]
    tint = tuple(map(float, rng.uniform(0.6, 1.0, 3)))
    look = mtlx(
        layer, "Glass", base=(FLOAT, 0.0), specular=(FLOAT, 1.0), specular_roughness=(FLOAT, 0.01),
        specular_IOR=(FLOAT, 1.5), transmission=(FLOAT, 1.0), transmission_color=(COLOR, tint),
    )  # fmt: skip
    shape = shapes.lathe(np.concatenate([outside, inside]), 48)
    layer.smooth(layer.mesh(layer.at("Body"), shape, look), shape)


def statue(layer: Layer, rng, number: int, folder: pathlib.Path, texture: int, size: float) -> None:
    """A scan: hundreds of thousands of triangles, with a 16 bit picture of its roughness."""
    picture(folder / f"tex/stone{number:03}.png", 0.3 + 0.6 * shapes.noise(rng, texture), 16)
    stone = layer.look(
        "Stone", diffuseColor=tuple(map(float, rng.uniform(0.3, 0.8, 3))),
        roughness=layer.texture("Stone", "Rough", f"./tex/stone{number:03}.png", output="r", color_space="raw"),
    )
    shape = shapes.moved(shapes.blob(rng, many(400000, size, 4000), 0.6, 1.3), (0, 0, 0.14), 0.11)
    layer.smooth(layer.mesh(layer.at("Scan"), shape, stone), shape)


def ornament(layer: Layer, rng, number: int, folder: pathlib.Path, texture: int) -> None:
    """Brushed metal in two rings and a stand."""
    metal = mtlx(
        layer, "Metal", base=(FLOAT, 1.0), base_color=(COLOR, tuple(map(float, rng.uniform(0.4, 0.95, 3)))),
        metalness=(FLOAT, 1.0), specular_roughness=(FLOAT, float(rng.uniform(0.08, 0.4))),
        specular_anisotropy=(FLOAT, 0.5),
    )  # fmt: skip
    turn = np.linspace(0, shapes.TAU, 60)
    for ring in range(2):
        radius = 0.07 + 0.03 * ring
        line = np.stack([radius * np.cos(turn), 0.3 * radius * np.sin(3 * turn), radius * np.sin(turn) + 0.12], -1)
        shape = shapes.tube(line, np.full(60, 0.006), 12)
        layer.smooth(layer.mesh(layer.at(f"Ring{ring}"), shape, metal), shape)
    layer.mesh(layer.at("Stand"), shapes.box(0.1, 0.06, 0.02), metal)


def write_props(folder: pathlib.Path, rng, size: float, texture: int) -> list[str]:
    """Files of props, light and heavy; most are books."""
    heavy = lambda *given: statue(*given, size)
    recipes = [(book, 60), (pot, 18), (bottle, 12), (heavy, 8), (ornament, 12)]
    names = []
    for recipe, count in recipes:
        for _ in range(many(count, size**0.5, 3)):
            name = f"prop{len(names):03}"
            layer = Layer(folder / f"props/{name}.usdc", "Prop", *AXIS)
            recipe(layer, rng, len(names), folder / "props", texture)
            layer.save()
            names.append(name)
    return names


def write_shelf(folder: pathlib.Path, rng, number: int, names: list[str], size: float) -> None:
    """A rack of boards, each full of instances of props."""
    layer = Layer(folder / f"shelf{number}.usdc", "Shelf", *AXIS, kind="group")
    grain = layer.look("Wood", diffuseColor=layer.texture("Wood", "Grain", "./tex/wood.png"), roughness=0.45)
    boards = [shapes.moved(shapes.box(1.2, 0.3, 0.02), (0, 0, 0.36 * row)) for row in range(SHELVES + 1)]
    boards += [shapes.moved(shapes.box(0.02, 0.3, 0.36 * SHELVES), (x, 0, 0)) for x in (-0.6, 0.6)]
    layer.mesh(layer.at("Boards"), shapes.joined(boards), grain)
    count = 0
    for row in range(SHELVES):
        x = -0.56
        while x < 0.54:
            name = names[rng.integers(len(names))]
            step = 0.055 if int(name[4:]) < _books(size) else 0.2
            if x + step < 0.58:
                layer.use(
                    layer.at(f"Row{row}/P{count}"), f"./props/{name}.usdc", instance=True,
                    place=(x + step / 2, rng.uniform(-0.03, 0.03), 0.36 * row + 0.02), degrees=rng.uniform(-6, 6),
                )
            x, count = x + step, count + 1
    layer.save()


def _books(size: float) -> int:
    return many(60, size**0.5, 3)


def wall(layer: Layer, name: str, size, place, look) -> None:
    layer.mesh(layer.at(f"Room/{name}"), shapes.moved(shapes.box(*size), place), look)


def write_room(layer: Layer, folder: pathlib.Path, rng, texture: int) -> None:
    """Floor, ceiling, walls, one with a window; a table."""
    y = np.linspace(0, 1, texture, endpoint=False)[:, None]
    rings = 0.5 + 0.5 * np.sin(y * 90 + 9 * shapes.noise(rng, texture, 1, 3)[..., 0])
    wood = np.array([0.45, 0.27, 0.13]) * (0.55 + 0.5 * rings[..., None])
    picture(folder / "tex/wood.png", wood)
    picture(folder / "tex/plaster.png", 0.62 + 0.2 * shapes.noise(rng, texture, 1, 10))
    floor = layer.look("Floor", diffuseColor=layer.texture("Floor", "Wood", "./tex/wood.png"), roughness=0.25)
    paint = layer.look("Paint", diffuseColor=layer.texture("Paint", "Plaster", "./tex/plaster.png"), roughness=0.9)
    wall(layer, "Floor", (WIDE, DEEP, 0.1), (0, 0, -0.1), floor)
    wall(layer, "Ceiling", (WIDE, DEEP, 0.1), (0, 0, TALL), paint)
    wall(layer, "Back", (WIDE, 0.1, TALL), (0, DEEP / 2, 0), paint)
    wall(layer, "Front", (WIDE, 0.1, TALL), (0, -DEEP / 2, 0), paint)
    wall(layer, "Right", (0.1, DEEP, TALL), (WIDE / 2, 0, 0), paint)
    for name, size, place in (
        ("Below", (0.1, DEEP, 0.9), (0, 0)), ("Above", (0.1, DEEP, 0.5), (0, 2.4)),
        ("Near", (0.1, 1.5, 1.5), (-1.75, 0.9)), ("Far", (0.1, 1.5, 1.5), (1.75, 0.9)),
    ):  # fmt: skip
        wall(layer, f"Left{name}", size, (-WIDE / 2, *place), paint)
    bars = [shapes.moved(shapes.box(0.05, 0.05, 1.5), (-WIDE / 2, y, 0.9)) for y in (-1.0, 0.0, 1.0)]
    layer.mesh(layer.at("Room/Frame"), shapes.joined(bars), floor)
    legs = [shapes.moved(shapes.box(0.06, 0.06, 0.7), (x, y, 0)) for x in (-0.7, 0.7) for y in (-0.4, 0.4)]
    top = shapes.moved(shapes.box(1.6, 1.0, 0.04), (0, 0, 0.7))
    layer.mesh(layer.at("Table"), shapes.moved(shapes.joined([*legs, top]), (0.1, -0.2, 0)), floor)


def write_clutter(layer: Layer, rng, names: list[str], size: float) -> None:
    """Props on the table and, in heaps, on the floor by a point instancer; cables as curves."""
    for count in range(14):
        x, y = -0.6 + 0.23 * (count % 7), -0.45 + 0.42 * (count // 7)
        layer.use(
            layer.at(f"OnTable/P{count}"), f"./props/{names[rng.integers(_books(size), len(names))]}.usdc",
            instance=True, place=(x, y, 0.74), degrees=rng.uniform(0, 360),
        )
    used = [names[number] for number in rng.choice(len(names), min(30, len(names)), replace=False)]
    paths = [layer.at(f"Heap/{name.capitalize()}") for name in used]
    count = many(600, size, 40)
    places = np.stack([
        rng.uniform(-WIDE / 2 + 0.2, WIDE / 2 - 0.2, count), rng.uniform(-1.2, DEEP / 2 - 0.5, count),
        0.02 + 0 * rng.random(count),
    ], -1)  # fmt: skip
    layer.instancer(
        layer.at("Heap"), paths, rng.integers(0, len(paths), count), places, shapes.turns(rng, count, 0.02),
        rng.uniform(0.6, 1.1, count),
    )
    for name, path in zip(used, paths):
        layer.use(path, f"./props/{name}.usdc")
    along = np.linspace(0, 1, 24)[None, :, None]
    start = np.stack([rng.uniform(-2, 2, 20), rng.uniform(-1.5, 1.5, 20), np.full(20, 0.012)], -1)[:, None]
    cables = start + along * rng.normal(size=(20, 1, 3)) * [0.8, 0.8, 0] + np.sin(along * 9) * [0.1, 0.07, 0]
    rubber = layer.look("Cable", diffuseColor=(0.04, 0.04, 0.045), roughness=0.5)
    layer.curves(layer.at("Cables"), cables, np.full((20, 24), 0.012), rubber)


def write_lights(layer: Layer, folder: pathlib.Path, rng) -> None:
    """A sky through the window, panels, bulbs, spots and lamp shades that shine themselves."""
    y, x = np.mgrid[0:64, 0:128] / [[[64]], [[128]]]
    sky = np.array([0.5, 0.75, 1.1]) * (1.3 - y[..., None]) + np.array([9.0, 7.5, 5.0]) * np.exp(
        -(((x - 0.55) / 0.05) ** 2 + ((y - 0.3) / 0.08) ** 2)
    )[..., None]
    (folder / "tex").mkdir(parents=True, exist_ok=True)
    images.hdr(folder / "tex/sky.hdr", sky)
    dome = UsdLux.DomeLight.Define(layer.stage, layer.at("Lights/Sky"))
    dome.CreateIntensityAttr(14.0)
    dome.CreateTextureFileAttr("./tex/sky.hdr")
    dome.CreateTextureFormatAttr("latlong")
    for number, x in enumerate((-1.4, 1.4)):
        panel = UsdLux.RectLight.Define(layer.stage, layer.at(f"Lights/Panel{number}"))
        panel.CreateWidthAttr(90.0)
        panel.CreateHeightAttr(30.0)
        panel.CreateIntensityAttr(45.0)
        panel.CreateColorAttr(Gf.Vec3f(1.0, 0.9, 0.75))
        layer.towards(panel, (x, 0.4, TALL - 0.02), (x, 0.401, 0))
    for number in range(8):
        bulb = UsdLux.SphereLight.Define(layer.stage, layer.at(f"Lights/Bulb{number}"))
        bulb.CreateRadiusAttr(2.5)
        bulb.CreateIntensityAttr(250.0)
        bulb.CreateColorAttr(Gf.Vec3f(*map(float, rng.uniform(0.5, 1.0, 3) * [1, 0.8, 0.6])))
        place = (rng.uniform(-2.5, 2.5), rng.uniform(-1, 2.2), rng.uniform(2.2, 2.7))
        bulb.AddTranslateOp().Set(Gf.Vec3d(*map(float, layer.lengths(place))))
    for number in range(4):
        spot = UsdLux.DiskLight.Define(layer.stage, layer.at(f"Lights/Spot{number}"))
        spot.CreateRadiusAttr(4.0)
        spot.CreateIntensityAttr(1500.0)
        shape = UsdLux.ShapingAPI.Apply(spot.GetPrim())
        shape.CreateShapingConeAngleAttr(35.0)
        shape.CreateShapingConeSoftnessAttr(0.3)
        layer.towards(spot, (-2.2 + 1.5 * number, 1.2, TALL - 0.05), (-2.2 + 1.5 * number, 2.3, 1.0))
    paper = layer.look("Shade", diffuseColor=(0.8, 0.75, 0.65))
    for number, place in enumerate([(-0.5, -0.2, 0.95), (2.3, 1.2, 1.6)]):
        shade = layer.mesh(
            layer.at(f"Lights/Shade{number}"),
            shapes.moved(shapes.lathe(np.array([[0.14, 0.0], [0.1, 0.25], [0.0, 0.25]]), 32), place), paper,
            double=True,
        )  # fmt: skip
        UsdLux.MeshLightAPI.Apply(shade.GetPrim())
        glow = UsdLux.LightAPI(shade.GetPrim())
        glow.CreateIntensityAttr(8.0)
        glow.CreateColorAttr(Gf.Vec3f(1.0, 0.75, 0.45))


def build(folder: pathlib.Path, seed: int, size: float, texture: int) -> pathlib.Path:
    rng = np.random.default_rng([0x1417, seed])
    names = write_props(folder, rng, size, texture)
    layer = Layer(folder / "interior.usda", "Interior", *AXIS, kind="assembly")
    write_room(layer, folder, rng, texture)
    shelves = min(many(4, size**0.5, 2), 8)
    for number in range(shelves):
        write_shelf(folder, rng, number, names, size)
    for place in range(8):
        along, back = (-2.2 + 1.4 * place, place < 4)
        where = (along, DEEP / 2 - 0.22, 0) if back else (WIDE / 2 - 0.22, 1.2 - 1.3 * (place - 4) + 0.6, 0)
        layer.use(
            layer.at(f"Shelves/Shelf{place}"), f"./shelf{place % shelves}.usdc", payload=True, place=where,
            degrees=0.0 if back else -90.0,
        )
    write_clutter(layer, rng, names, size)
    write_lights(layer, folder, rng)
    layer.camera((-1.9, -2.2, 1.55), (0.9, 1.2, 0.85), focal=20.0, near=0.02, far=100.0)
    layer.save()
    return layer.path


if __name__ == "__main__":
    run("interior", build, 1024)
