# SPDX-License-Identifier: Apache-2.0
"""Spheres of five roughnesses, dielectric and metal, on boards under a sky with a sun: textured dome, roughness x
metallic."""

import images
import parts
import patterns
import shading
import solids

ROUGHNESS = (0.0, 0.15, 0.3, 0.55, 0.9)
ROWS = (("Plastic", 0.0, (0.65, 0.06, 0.04)), ("Half", 0.5, (0.15, 0.35, 0.55)), ("Gold", 1.0, (1.0, 0.71, 0.29)))


def build(stage, folder, options):
    images.exr(folder / "sky.exr", patterns.sky(512, haze=0.2, sun=(0.75, 0.55, 0.35)), half=True, packed=True)
    color, roughness = patterns.wood(512)
    images.png(folder / "boards.png", images.to_8_bit(images.to_srgb(color)), packed=True)
    images.png(folder / "boards_roughness.png", images.to_8_bit(roughness), packed=True)
    boards = shading.material(
        stage, "/World/Looks/Boards",
        diffuseColor=shading.sample(stage, "/World/Looks/Boards/Color", "./boards.png"),
        roughness=shading.sample(stage, "/World/Looks/Boards/Roughness", "./boards_roughness.png", "r"),
    )  # fmt: skip
    shading.bind(solids.ground(stage, "/World/Table", 70.0, 20.0), boards)
    for row, (name, metallic, base) in enumerate(ROWS):
        for column, value in enumerate(ROUGHNESS):
            look = shading.material(
                stage, f"/World/Looks/{name}{column}", diffuseColor=base, metallic=metallic, roughness=value
            )
            ball = solids.sphere(stage, f"/World/{name}{column}", 0.46, 32)
            solids.put(ball, (1.04 * column - 2.08 + 0.3 * (row - 1) + 0.25, 0.46, 1.3 - 1.3 * row))
            shading.bind(ball, look)
    parts.dome(stage).CreateTextureFileAttr("./sky.exr")
    parts.camera(stage, "/World/Camera", (0.0, 2.2, 7.6), (0.05, 0.72, 0.0), aperture=(36.0, 20.25), focal=42.0)
