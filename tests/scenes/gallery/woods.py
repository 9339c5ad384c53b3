# SPDX-License-Identifier: Apache-2.0
"""A textured wood of any size: trees of bark and cut-out leaf cards, each kind with pictures of its own.

For the proof that geometry and textures are paged under one budget. Options, all with small defaults:
    kinds     4      kinds of trees: each a mesh of its own, and pictures of its own
    size 256 texels along a side of each picture (bark, bark normals, leaves): 4 * 4/3 bytes each, three pictures a kind
    cards     520    leaf cards of a tree
    trees     160    instances
    detail    24     rings of a trunk
Geometry is about kinds * (cards * 16 + detail * 64) triangles; texels about kinds * 3 * size^2.
"""

import math

import numpy as np
from pxr import Gf

import images
import parts
import patterns
import shading
import solids

DEFAULTS = {"kinds": 4, "size": 256, "cards": 520, "trees": 160, "detail": 24}


def paint(folder, kind, size):
    """Pictures of a kind; large ones are small ones laid side by side in other brightnesses, so that gigabytes take
    minutes."""
    tile = min(size, 512)
    color, height = patterns.bark(tile, 9 + kind)
    rgba = patterns.leaf(tile, 0.9 * ((kind * 0.37) % 1.0), kind + 1)
    leaf = np.concatenate([images.to_srgb(rgba[..., :3]), rgba[..., 3:]], axis=-1)
    repeat = size // tile
    for name, picture in (
        ("bark", images.to_srgb(color)),
        ("bark_normal", patterns.normals_of(height, 0.03)),
        ("leaf", leaf),
    ):
        if repeat > 1 and name != "leaf":
            tint = (
                np.random.default_rng(kind).uniform(0.85, 1.0, (repeat, repeat, 1))
                if name == "bark"
                else np.ones((repeat, repeat, 1))
            )
            picture = np.tile(picture, (repeat, repeat, 1)) * np.kron(tint, np.ones((tile, tile, 1)))
        elif repeat > 1:
            picture = np.kron(picture, np.ones((repeat, repeat, 1)))
        images.png(folder / f"{name}{kind}.png", images.to_8_bit(picture), packed=True)


def tree(stage, path, kind, options):
    """A trunk and one mesh of all leaf cards, bound to the kind's materials."""
    random = np.random.default_rng(100 + kind)
    tall = 3.4 + 1.6 * random.uniform()
    heights = np.linspace(0, tall, int(options["detail"]) + 1)
    radius = 0.20 * (1 - heights / tall) ** 0.8 + 0.015 + 0.07 * np.exp(-heights * 4)
    trunk = solids.lathe(
        stage, f"{path}/Trunk", [(0.0, 0.0), *zip(radius, heights + 1e-3), (0.0, tall + 0.05)], 20,
        tiles=(2.0, 2 * tall),
    )
    look = f"/World/Looks/Bark{kind}"
    shading.bind(trunk, shading.material(
        stage, look, diffuseColor=shading.sample(stage, f"{look}/Color", f"./bark{kind}.png"),
        normal=shading.normal_map(stage, f"{look}/Normal", f"./bark_normal{kind}.png"), roughness=0.9,
    ))  # fmt: skip
    cards = int(options["cards"])
    cone = kind % 2 == 0
    up = 0.28 * tall + 0.75 * tall * random.uniform(0, 1, cards) ** (1.3 if cone else 0.8)
    spread = (
        (1.15 * (1.06 - up / tall) + 0.1)
        if cone
        else 1.15 * np.sqrt(np.clip(1 - ((up - 0.68 * tall) / (0.45 * tall)) ** 2, 0.04, 1))
    )
    angle, out = random.uniform(0, 2 * math.pi, cards), spread * random.uniform(0.35, 1.0, cards)
    middle = np.stack([out * np.sin(angle), up, out * np.cos(angle)], axis=1)
    right = random.normal(size=(cards, 3))
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    facing = np.cross(right, random.normal(size=(cards, 3)))
    facing /= np.linalg.norm(facing, axis=1, keepdims=True)
    above = np.cross(facing, right)
    half = random.uniform(0.09, 0.17, (cards, 1))
    corners = np.stack(
        [
            middle - half * right - half * above, middle + half * right - half * above,
            middle + half * right + half * above, middle - half * right + half * above,
        ],
        axis=1,
    )
    # 2 x 2 quads a card, slightly bowed.
    points, st = [], []
    for t in (0.0, 0.5, 1.0):
        for s in (0.0, 0.5, 1.0):
            flat = (1 - t) * ((1 - s) * corners[:, 0] + s * corners[:, 1]) + t * (
                (1 - s) * corners[:, 3] + s * corners[:, 2]
            )
            points.append(flat + facing * half * 0.3 * (1 - (2 * s - 1) ** 2))
            st.append((s, t))
    points = np.stack(points, axis=1).reshape(-1, 3)
    cell = np.array([0, 1, 4, 3, 1, 2, 5, 4, 3, 4, 7, 6, 4, 5, 8, 7])
    indices = (np.arange(cards)[:, None] * 9 + cell).ravel()
    leaves = solids.raw_mesh(
        stage, f"{path}/Leaves", points, [4] * (4 * cards), indices, np.repeat(facing, 16, axis=0),
        np.tile(np.array(st)[cell], (cards, 1)),
    )
    look = f"/World/Looks/Leaves{kind}"
    shading.bind(leaves, shading.material(
        stage, look, diffuseColor=shading.sample(stage, f"{look}/Picture", f"./leaf{kind}.png", wrap="clamp"),
        opacity=shading.sample(stage, f"{look}/Picture", f"./leaf{kind}.png", "a"), opacityThreshold=0.5, roughness=0.6,
    ))  # fmt: skip


def build(stage, folder, options):
    options = {**DEFAULTS, **options}
    kinds, trees = int(options["kinds"]), int(options["trees"])
    for kind in range(kinds):
        paint(folder, kind, int(options["size"]))
    random = np.random.default_rng(3)
    side = 30.0 * math.sqrt(trees / 160)
    names = [f"/World/Trees/Kind{kind}" for kind in range(kinds)]
    places = np.stack(
        [random.uniform(-side / 2, side / 2, trees), np.zeros(trees), 4.0 - side * random.uniform(0, 1, trees) ** 1.15],
        axis=1,
    )
    # A glade in front of the camera.
    places[:, 0] += np.where(
        (np.abs(places[:, 0]) < 2.4) & (places[:, 2] > -9), np.where(places[:, 0] < 0, -2.6, 2.6), 0.0
    )
    turns = [parts.turned((0, 1, 0), float(a)) for a in random.uniform(0, 360, trees)]
    parts.instancer(
        stage, "/World/Trees", names, (np.arange(trees) % kinds).tolist(), places.tolist(), turns,
        [(s, s, s) for s in random.uniform(0.75, 1.35, trees)],
    )
    for kind, name in enumerate(names):
        stage.DefinePrim(name, "Xform")
        tree(stage, name, kind, options)
    s, t = patterns.plane(512, 512)
    moss = patterns.mix(
        (0.10, 0.085, 0.045), (0.16, 0.24, 0.06), patterns.smooth_step(0.4, 0.62, patterns.noise(s, t, 6, 31, 5))
    )
    images.png(
        folder / "moss.png",
        images.to_8_bit(images.to_srgb(moss * (0.7 + 0.6 * patterns.noise(s, t, 48, 7, 2))[..., None])), packed=True,
    )
    look = shading.material(
        stage, "/World/Looks/Moss", diffuseColor=shading.sample(stage, "/World/Looks/Moss/Color", "./moss.png"),
        roughness=1.0,
    )
    shading.bind(solids.ground(stage, "/World/Ground", 6 * side, side), look)
    images.exr(
        folder / "sky.exr", patterns.sky(512, haze=0.2, sun=(-0.6, 0.55, -0.25), sun_radiance=2600.0), half=True,
        packed=True,
    )
    dome = parts.dome(stage)
    dome.CreateTextureFileAttr("./sky.exr")
    dome.CreateColorAttr(Gf.Vec3f(1.0, 0.97, 0.92))
    parts.camera(stage, "/World/Camera", (0.0, 1.7, 8.2), (0.0, 1.75, 0.0), aperture=(36.0, 20.25), focal=27.0)
