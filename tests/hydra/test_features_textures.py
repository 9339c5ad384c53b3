# SPDX-License-Identifier: Apache-2.0
"""Feature scenes of textures against known answers, both front ends: emission shows what was looked up. Scenes:
tests/scenes/feature_textures.py."""

import math

import compare
import feature_textures as scenes
import featured
import numpy as np
from feature_surfaces import EIGHT


def test_texture_orientation(host):
    """st (0, 0) is the lower left of the picture as it is looked at."""
    made = featured.picture(host, "texture_orientation", (32, 32), samples=64)
    for t in range(2):
        for s in range(4):
            compare.near(
                made[16 * t + 5 : 16 * t + 11, 8 * s + 3 : 8 * s + 5], EIGHT[1 - t, s] / 255.0, 2e-5,
                f"block {s} {t}",
            )


def _wrapped(mode, position: float) -> float | None:
    if mode in (None, "black"):
        return position if 0 <= position <= 1 else None
    if mode == "clamp":
        return min(max(position, 1 / 64), 1 - 1 / 64)
    if mode == "repeat":
        return position % 1.0
    folded = position % 2.0
    return folded if folded <= 1 else 2 - folded


def test_texture_wrap(host):
    """Nine periods of the picture for each mode; outside is transparent black for black and for useMetadata without
    metadata."""
    size = 60
    made = featured.picture(host, "texture_wrap", (5 * size, 5 * size), samples=64)
    for index, mode in enumerate(scenes.WRAPS):
        # 0.9 of the cell is the square; a period is 18 pixels, a block 4.5 x 9.
        left, bottom = index * size + 3, 2 * size + 3
        for v in range(6):
            for u in range(12):
                x, y = left + 4.5 * u + 2.25, bottom + 9 * v + 4.5
                s, t = _wrapped(mode, (u + 0.5) / 4 - 1), _wrapped(mode, (v + 0.5) / 2 - 1)
                expected = (0, 0, 0) if s is None or t is None else EIGHT[1 - int(t * 2), int(s * 4)] / 255.0
                compare.near(
                    made[int(y) - 1 : int(y) + 2, int(x) : int(x) + 1], expected, 1e-4, f"{mode}, block {u} {v}"
                )


def test_texture_values(host):
    """scale and bias after the lookup, fallback, (r, r, r) of grey pictures, a of two and four channels."""
    expected = [
        (0.2 * 2 + 0.1, 0.4 + 0.2, 0.6 * 0.5 + 0.3), (0.7, 0.5, 0.3), (0.2, 0.2, 0.2), (0.4, 0.4, 0.4), (0.5, 0.5, 0.5),
        (0, 0, 0),
    ]
    for index, (cell, color) in enumerate(zip(featured.row_of(host, "texture_values", 6), expected)):
        compare.near(cell, color, 1e-5, f"square {index}")


def test_texture_color_space(host):
    """auto decodes 8-bit pictures of three and four channels only; sRGB decodes whatever it is given; raw nothing."""
    half = 128 / 255
    decoded = ((half + 0.055) / 1.055) ** 2.4
    expected = [decoded, decoded, half, 32768 / 65535, half, decoded, 0.5]
    for cell, value, (file, space) in zip(featured.row_of(host, "texture_color_space", 7), expected, scenes.SPACES):
        compare.near(cell, value, 1e-4, f"{file} as {space}")


def test_texture_transform(host):
    """UsdTransform2d scales, then rotates counterclockwise, then translates st."""
    size = 64
    made = featured.picture(host, "texture_transform", (size, size), samples=64)
    turn = math.radians(scenes.TRANSFORM["rotation"])
    sure = 0
    for row in range(2, size - 2):
        for column in range(2, size - 2):
            places = []
            for dx, dy in ((-3, -3), (4, -3), (-3, 4), (4, 4)):
                s, t = (column + dx) / size * scenes.TRANSFORM["scale"][0], (row + dy) / size * scenes.TRANSFORM[
                    "scale"
                ][1]
                s, t = (
                    s * math.cos(turn) - t * math.sin(turn) + scenes.TRANSFORM["translation"][0],
                    s * math.sin(turn) + t * math.cos(turn) + scenes.TRANSFORM["translation"][1],
                )
                places.append((math.floor(s * 4 + 1e-9) % 4, math.floor(t * 2 + 1e-9) % 2))
            # A texel is 4 x 2 pixels here. Pixels whose surroundings are in one block.
            if len(set(places)) == 1:
                s, t = places[0]
                compare.near(made[row, column], EIGHT[1 - t, s] / 255.0, 1e-4, f"pixel {column} {row}")
                sure += 1
    assert sure > 1000


def test_udim(host):
    """Each unit square of st has the tile of its number; a tile that is not there gives the fallback (black) and a
    warning, no failure."""
    made = featured.picture(host, "texture_udim", (32, 32), samples=64)
    for tile, color in scenes.UDIMS.items():
        u, v = (tile - 1001) % 10, (tile - 1001) // 10
        compare.near(
            made[16 * v + 4 : 16 * v + 12, 16 * u + 4 : 16 * u + 12], np.array(color) / 255.0, 1e-5, f"tile {tile}"
        )
    compare.near(made[20:28, 20:28], 0.0, 1e-5, "no tile")


def test_usdz(host):
    """A picture inside a package."""
    made = featured.picture(host, "texture_usdz", (32, 32), samples=64)
    for t in range(2):
        for s in range(4):
            compare.near(
                made[16 * t + 5 : 16 * t + 11, 8 * s + 3 : 8 * s + 5], EIGHT[1 - t, s] / 255.0, 2e-5,
                f"block {s} {t}",
            )
