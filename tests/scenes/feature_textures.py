# SPDX-License-Identifier: Apache-2.0
"""Feature scenes of textures; answers in tests/hydra/test_features_textures.py. Squares and pictures are as in
feature_surfaces.py. Written by features.py."""

from __future__ import annotations

import numpy as np
from pxr import Gf, Usd, UsdUtils

import images
import parts
import shading
from feature_surfaces import glow, row, write_eight


def texture_orientation(stage, folder):
    """A picture of eight colours on a square, raw: st starts at the lower left."""
    write_eight(folder)
    row(
        stage,
        [
            glow(
                stage,
                "Eight",
                shading.sample(
                    stage, "/World/Looks/Eight/Picture", "./maps/eight.png", color_space="raw", wrap="clamp"
                ),
            )
        ],
        1.0,
        1.0,
    )


WRAPS = (None, "black", "clamp", "repeat", "mirror")


def texture_wrap(stage, folder):
    """The picture on st from -1 to 2, with every wrap mode; none authored is useMetadata, which is black here."""
    write_eight(folder)
    for index, mode in enumerate(WRAPS):
        square = parts.quad(stage, f"/World/Square{index}", 0.9, None)
        square.AddTranslateOp().Set(Gf.Vec3d(index - 2, 0, 0))
        shading.coordinates(square, [(-1, -1), (2, -1), (2, 2), (-1, 2)])
        shading.bind(
            square,
            glow(
                stage,
                f"Wrap{index}",
                shading.sample(
                    stage, f"/World/Looks/Wrap{index}/Picture", "./maps/eight.png", color_space="raw", wrap=mode
                ),
            ),
        )
    parts.orthographic(stage, "/World/Camera", (0, 0, 5), (0, 0, 0), 5.0)


def texture_values(stage, folder):
    """scale and bias; fallback of a file that is not there; the channels of a one-, two- and four-channel picture."""
    flat = lambda name, *value: images.png(
        folder / f"maps/{name}.png", np.broadcast_to(np.array(value, np.uint8), (8, 8, len(value)))
    )
    flat("grey", 51), flat("grey_alpha", 102, 204), flat("rgba", 51, 102, 153, 204)
    sample = lambda index, *a, **o: shading.sample(
        stage, f"/World/Looks/Value{index}/Picture", *a, color_space="raw", **o
    )
    looks = [
        glow(stage, "Value0", sample(0, "./maps/rgba.png", scale=(2, 1, 0.5, 1), bias=(0.1, 0.2, 0.3, 0))),
        glow(stage, "Value1", sample(1, "./maps/not_there.png", fallback=(0.7, 0.5, 0.3, 1))),
        glow(stage, "Value2", sample(2, "./maps/grey.png")),
        glow(stage, "Value3", sample(3, "./maps/grey_alpha.png")),
        glow(stage, "Value4", (0.5, 0.5, 0.5), opacity=sample(4, "./maps/grey_alpha.png", "a"), opacityThreshold=0.75),
        glow(stage, "Value5", (0.5, 0.5, 0.5), opacity=sample(5, "./maps/rgba.png", "a"), opacityThreshold=0.85),
    ]
    row(stage, looks)


SPACES = (
    ("rgba8", "auto"), ("rgba8", "sRGB"), ("rgba8", "raw"), ("rgb16", "auto"), ("grey8", "auto"), ("grey8", "sRGB"),
    ("float", "auto"),
)


def texture_color_space(stage, folder):
    """0.5 in pictures of several kinds, with sourceColorSpace auto, sRGB, raw: which are decoded."""
    images.png(folder / "maps/rgba8.png", np.full((8, 8, 4), 128, np.uint8))
    images.png(folder / "maps/rgb16.png", np.full((8, 8, 3), 32768, np.uint16))
    images.png(folder / "maps/grey8.png", np.full((8, 8, 1), 128, np.uint8))
    images.exr(folder / "maps/float.exr", np.full((8, 8, 3), 0.5))
    looks = []
    for index, (file, space) in enumerate(SPACES):
        name = f"./maps/{file}.{'exr' if file == 'float' else 'png'}"
        looks.append(
            glow(
                stage, f"Space{index}",
                shading.sample(stage, f"/World/Looks/Space{index}/Picture", name, color_space=space),
            )
        )
    row(stage, looks)


TRANSFORM = dict(scale=(2.0, 0.5), rotation=90.0, translation=(1.0, 0.25))


def texture_transform(stage, folder):
    """UsdTransform2d: scale, rotate, translate, in that order."""
    write_eight(folder)
    st = shading.primvar(stage, "/World/Looks/Moved/St", "st")
    moved = shading.transform2d(stage, "/World/Looks/Moved/Transform", st, **TRANSFORM)
    row(
        stage,
        [
            glow(
                stage, "Moved",
                shading.sample(stage, "/World/Looks/Moved/Picture", "./maps/eight.png", st=moved, color_space="raw"),
            )
        ],
        1.0,
        1.0,
    )


UDIMS = {1001: (255, 51, 0), 1002: (0, 255, 102), 1011: (51, 0, 255)}


def texture_udim(stage, folder):
    """st from 0 to 2: three tiles of four are there, the fourth shows the fallback or black."""
    for tile, color in UDIMS.items():
        images.png(folder / f"maps/tiles.{tile}.png", np.broadcast_to(np.array(color, np.uint8), (8, 8, 3)))
    square = parts.quad(stage, "/World/Square", 1.0, None)
    shading.coordinates(square, [(0, 0), (2, 0), (2, 2), (0, 2)])
    shading.bind(
        square,
        glow(
            stage,
            "Tiles",
            shading.sample(
                stage, "/World/Looks/Tiles/Picture", "./maps/tiles.<UDIM>.png", color_space="raw", wrap=None
            ),
        ),
    )
    parts.orthographic(stage, "/World/Camera", (0, 0, 5), (0, 0, 0), 1.0)


def texture_usdz(stage, folder):
    """A square with its material and picture from a .usdz package."""
    write_eight(folder)
    inner = Usd.Stage.CreateNew(str(folder / "maps/packed.usda"))
    inner.SetDefaultPrim(inner.DefinePrim("/Asset", "Xform"))
    square = parts.quad(inner, "/Asset/Square", 1.0, None)
    shading.coordinates(square, [(0, 0), (1, 0), (1, 1), (0, 1)])
    path = "/Asset/Look"
    picture = shading.sample(inner, f"{path}/Picture", "./eight.png", color_space="raw", wrap="clamp")
    shading.bind(
        square,
        shading.material(
            inner, path, diffuseColor=(0, 0, 0), emissiveColor=picture, useSpecularWorkflow=1, specularColor=(0, 0, 0),
            roughness=1.0,
        ),
    )
    inner.GetRootLayer().Save()
    UsdUtils.CreateNewUsdzPackage(str(folder / "maps/packed.usda"), str(folder / "maps/packed.usdz"))
    (folder / "maps/packed.usda").unlink()
    stage.DefinePrim("/World/Asset", "Xform").GetReferences().AddReference("./maps/packed.usdz")
    parts.orthographic(stage, "/World/Camera", (0, 0, 5), (0, 0, 0), 1.0)


SCENES = [
    texture_orientation, texture_wrap, texture_values, texture_color_space, texture_transform, texture_udim,
    texture_usdz,
]  # fmt: skip
