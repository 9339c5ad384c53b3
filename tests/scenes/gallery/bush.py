# SPDX-License-Identifier: Apache-2.0
"""A bush of leaves with cut-out opacity, instances of four prototypes. `leaves` sets how many (1000), `opaque` drops
the cut-outs."""

import math

import numpy as np
from pxr import Gf

import images
import parts
import patterns
import shading
import solids


def leaf_looks(stage, folder, size, opaque=False, threshold=0.5):
    """Four pictures of leaves, each with its material."""
    looks = []
    for index in range(4):
        rgba = patterns.leaf(size, 0.22 * index, index + 1)
        encoded = np.concatenate([images.to_srgb(rgba[..., :3]), rgba[..., 3:]], axis=-1)
        images.png(folder / f"leaf{index}.png", images.to_8_bit(encoded), packed=True)
        path = f"/World/Looks/Leaf{index}"
        inputs = dict(
            diffuseColor=shading.sample(stage, f"{path}/Picture", f"./leaf{index}.png", wrap="clamp"), roughness=0.5
        )
        if not opaque:
            inputs.update(
                opacity=shading.sample(stage, f"{path}/Picture", f"./leaf{index}.png", "a"), opacityThreshold=threshold
            )
        looks.append(shading.material(stage, path, **inputs))
    return looks


def scatter(count, seed, radius):
    """Places and turns (w, x, y, z) of leaves that point away from the middle of a lumpy ball."""
    random = np.random.default_rng(seed)
    d = random.normal(size=(count, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    d[:, 1] = np.abs(d[:, 1]) * 1.1 - 0.25
    lumps = 1.0 + 0.18 * np.sin(5 * d[:, 0] + 1) * np.cos(4 * d[:, 2]) + 0.1 * np.sin(9 * d[:, 1])
    places = d * (radius * lumps * random.uniform(0.55, 1.0, count) ** 0.6)[:, None] * [1, 0.85, 1]
    turns = []
    for direction, twist in zip(d, random.uniform(-1, 1, (count, 3))):
        away = Gf.Vec3d(*(direction + 0.45 * twist + [0, 0.15, 0]))
        lean = Gf.Rotation(Gf.Vec3d(0, 1, 0), away.GetNormalized())
        spin = Gf.Rotation(Gf.Vec3d(0, 1, 0), float(180 * twist[0]))
        q = (spin * lean).GetQuat()
        turns.append((q.GetReal(), *q.GetImaginary()))
    return places, turns, random


def build(stage, folder, options):
    count = int(options.get("leaves", 1000))
    looks = leaf_looks(stage, folder, 256, opaque=bool(options.get("opaque", False)))
    places, turns, random = scatter(count, 4, 1.15)
    places = places + [0, 1.0, 0]
    scales = random.uniform(0.7, 1.25, count) * (1000 / count) ** 0.25
    names = [f"/World/Bush/Leaf{index}" for index in range(4)]
    parts.instancer(
        stage, "/World/Bush", names, random.integers(0, 4, count).tolist(), places.tolist(), turns,
        [(s, s, s) for s in scales],
    )
    for name, look in zip(names, looks):
        shading.bind(solids.card(stage, name, 0.30, 0.42, 2, 4, 0.07), look)
    wood = shading.material(stage, "/World/Looks/Twig", diffuseColor=(0.16, 0.09, 0.05), roughness=0.8)
    for index in range(9):
        angle = 2 * math.pi * index / 9
        twig = solids.lathe(stage, f"/World/Twig{index}", [(0.0, 0.0), (0.035, 0.0), (0.02, 0.9), (0.0, 1.5)], 10)
        shading.bind(
            solids.put(twig, (0.12 * math.sin(angle), 0.0, 0.12 * math.cos(angle)), turn=math.degrees(angle), tilt=22),
            wood,
        )
    images.png(
        folder / "earth.png",
        images.to_8_bit(
            images.to_srgb(
                patterns.mix((0.16, 0.12, 0.07), (0.30, 0.25, 0.15), patterns.noise(*patterns.plane(256, 256), 8, 3, 5))
            )
        ),
        packed=True,
    )
    earth = shading.material(
        stage, "/World/Looks/Earth", diffuseColor=shading.sample(stage, "/World/Looks/Earth/Color", "./earth.png"),
        roughness=0.95,
    )
    shading.bind(solids.ground(stage, "/World/Ground", 80.0, 20.0), earth)
    images.exr(folder / "sky.exr", patterns.sky(512, haze=0.2, sun=(0.7, 0.6, 0.45)), half=True, packed=True)
    parts.dome(stage).CreateTextureFileAttr("./sky.exr")
    parts.camera(stage, "/World/Camera", (0.0, 1.25, 6.2), (0.0, 1.12, 0.0), aperture=(36.0, 20.25), focal=42.0)
