# SPDX-License-Identifier: Apache-2.0
"""A sign of emissive letters over a wet street, a cube whose faces have materials of their own, beads coloured by
instance-rate primvars."""

import colorsys

from pxr import Gf, Sdf, UsdGeom, Vt

import parts
import shading
import solids

LETTERS = {
    "H": ["# #", "# #", "###", "# #", "# #"], "Y": ["# #", "# #", " # ", " # ", " # "],
    "D": ["## ", "# #", "# #", "# #", "## "],
    "R": ["## ", "# #", "## ", "# #", "# #"], "A": [" # ", "# #", "###", "# #", "# #"],
}  # fmt: skip


def letters(stage, path, word, cell):
    """One mesh of boxes, one per lit cell of the letters."""
    points, indices = [], []
    pen = 0.0
    for letter in word:
        for row, line in enumerate(LETTERS[letter]):
            for column, mark in enumerate(line):
                if mark == "#":
                    first = len(points)
                    x, y = pen + column * cell, (4 - row) * cell
                    points += [
                        (x + a, y + b, c) for c in (-0.04, 0.04) for b in (0, 0.92 * cell) for a in (0, 0.92 * cell)
                    ]
                    indices += [
                        first + k for k in (0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5)
                    ]
        pen += 4 * cell
    middle = (pen - cell) / 2
    return parts.mesh(stage, path, [(x - middle, y, z) for x, y, z in points], [4] * (len(indices) // 4), indices, None)


def build(stage, folder, options):
    neon = shading.material(
        stage, "/World/Looks/Neon", diffuseColor=(0, 0, 0), emissiveColor=(11.0, 2.2, 0.7), roughness=0.6
    )
    shading.bind(solids.put(letters(stage, "/World/Sign", "HYDRA", 0.22), (0, 1.35, -1.2)), neon)
    wet = shading.material(stage, "/World/Looks/Street", diffuseColor=(0.05, 0.05, 0.055), roughness=0.22)
    shading.bind(solids.ground(stage, "/World/Street", 20.0), wet)
    wall = shading.material(stage, "/World/Looks/Wall", diffuseColor=(0.30, 0.29, 0.28), roughness=0.9)
    shading.bind(solids.put(solids.block(stage, "/World/Wall", (9, 5, 0.2)), (0, 2.5, -1.5)), wall)
    cube = solids.put(solids.block(stage, "/World/Cube", (0.9, 0.9, 0.9), (0.4, 0.4, 0.4)), (-1.6, 0.45, 0.4), turn=32)
    shading.bind(
        cube, shading.material(stage, "/World/Looks/Steel", diffuseColor=(0.8, 0.8, 0.82), metallic=1.0, roughness=0.18)
    )
    for name, faces, inputs in (
        ("front", [0], dict(diffuseColor=(0.02, 0.1, 0.1), emissiveColor=(0.05, 0.5, 0.42), roughness=0.4)),
        ("side", [2], dict(diffuseColor=(0.7, 0.55, 0.1), roughness=0.35)),
        ("top", [4], dict(diffuseColor=(0.5, 0.05, 0.3), roughness=0.5, clearcoat=1.0)),
    ):
        shading.subset(cube, name, faces, shading.material(stage, f"/World/Looks/Cube_{name}", **inputs))
    count = 60
    places = [(-0.55 + 0.24 * (k % 12), 0.1 + 0.2 * (k // 12), 0.9) for k in range(count)]
    beads = parts.instancer(stage, "/World/Beads", ["/World/Beads/Bead"], [0] * count, places)
    colors = [Gf.Vec3f(*colorsys.hsv_to_rgb(k / count, 0.8, 0.85)) for k in range(count)]
    UsdGeom.PrimvarsAPI(beads).CreatePrimvar(
        "displayColor", Sdf.ValueTypeNames.Color3fArray, UsdGeom.Tokens.vertex
    ).Set(Vt.Vec3fArray(colors))
    solids.sphere(stage, "/World/Beads/Bead", 0.095, 16)
    solids.put(solids.sphere(stage, "/World/Plain", 0.4, 32, (0.15, 0.4, 0.2)), (2.55, 0.4, 0.2))
    parts.dome(stage, 0.02)
    parts.camera(stage, "/World/Camera", (0.1, 1.35, 6.2), (0.1, 1.15, 0.0), aperture=(36.0, 20.25), focal=40.0)
