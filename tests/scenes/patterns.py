# SPDX-License-Identifier: Apache-2.0
"""Pictures for the test scenes, reckoned by numpy: skies, checkers, wood, bricks, leaves, maps made from heights. Row 0
at the top.

Colours are linear unless a name says otherwise. Everything is a pure function of its arguments.
"""

from __future__ import annotations

import math

import numpy as np


def plane(width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """s and t of the texel centres, t = 0 at the bottom row (the last)."""
    s = (np.arange(width) + 0.5) / width
    t = 1.0 - (np.arange(height) + 0.5) / height
    return np.meshgrid(s, t)


def noise(s: np.ndarray, t: np.ndarray, cells: int, seed: int, octaves: int = 4) -> np.ndarray:
    """Value noise that repeats with the unit square, 0 .. 1."""
    total, weight = np.zeros_like(s), 0.0
    for octave in range(octaves):
        n = cells << octave
        table = np.random.default_rng(seed * 101 + octave).uniform(0, 1, (n, n))
        x, y = s * n, t * n
        ix, iy = np.floor(x).astype(int), np.floor(y).astype(int)
        fx, fy = x - ix, y - iy
        fx, fy = fx * fx * (3 - 2 * fx), fy * fy * (3 - 2 * fy)
        at = lambda a, b: table[(iy + b) % n, (ix + a) % n]
        value = (at(0, 0) * (1 - fx) + at(1, 0) * fx) * (1 - fy) + (at(0, 1) * (1 - fx) + at(1, 1) * fx) * fy
        total += value / (1 << octave)
        weight += 1.0 / (1 << octave)
    return total / weight


def mix(a, b, factor) -> np.ndarray:
    """a where factor is 0, b where it is 1."""
    factor = np.asarray(factor)[..., None]
    return np.asarray(a) * (1 - factor) + np.asarray(b) * factor


def smooth_step(low: float, high: float, x: np.ndarray) -> np.ndarray:
    x = np.clip((x - low) / (high - low), 0, 1)
    return x * x * (3 - 2 * x)


def latlong_directions(width: int, height: int) -> np.ndarray:
    """Directions of a latlong's texel centres: its middle is +z, +x is a quarter from the left, +y at the top
    (OpenEXR's rule, which UsdLux follows)."""
    longitude = math.pi - 2 * math.pi * (np.arange(width) + 0.5) / width
    latitude = math.pi / 2 - math.pi * (np.arange(height) + 0.5) / height
    longitude, latitude = np.meshgrid(longitude, latitude)
    return np.stack(
        [np.cos(latitude) * np.sin(longitude), np.sin(latitude), np.cos(latitude) * np.cos(longitude)], axis=-1
    )


def sky(
    width: int = 512,
    sun=(0.55, 0.5, 0.62),
    sun_degrees: float = 1.4,
    sun_radiance: float = 1800.0,
    warmth: float = 1.0,
    haze: float = 0.0,
) -> np.ndarray:
    """A latlong sky with some clouds, ground below the horizon (behind haze down to `-haze`), and a small bright sun
    towards `sun`."""
    d = latlong_directions(width, width // 2)
    up = d[..., 1]
    high = np.clip(up, 0, 1)
    blue = mix((0.62, 0.70, 0.80), (0.10, 0.24, 0.62), high**0.5)
    clouds = noise(np.arctan2(d[..., 0], d[..., 2]) / (2 * math.pi) + 0.5, np.clip(high, 0, 0.999), 5, 11)
    blue = mix(blue, (1.05, 1.0, 0.96), 0.75 * smooth_step(0.52, 0.72, clouds) * smooth_step(0.02, 0.25, up))
    picture = np.where((up > 0)[..., None], blue, mix((0.24, 0.21, 0.18), (0.08, 0.07, 0.06), np.clip(-up, 0, 1)))
    if haze > 0:
        veil = (1 - smooth_step(0.0, haze, -up)) * (up <= 0)
        picture = mix(picture, (0.62, 0.70, 0.80), veil)
    towards = np.asarray(sun) / np.linalg.norm(sun)
    angle = np.degrees(np.arccos(np.clip(d @ towards, -1, 1)))
    picture = picture + np.array([1.0, 0.85, 0.6]) * 0.9 * np.exp(-angle / 9.0)[..., None]
    disk = 1 - smooth_step(sun_degrees * 0.8, sun_degrees * 1.2, angle)
    return picture + disk[..., None] * sun_radiance * np.array([1.0, 1.0 - 0.08 * warmth, 1.0 - 0.25 * warmth])


def studio(width: int = 512) -> np.ndarray:
    """A dim studio: two soft boxes, a strip, a dark floor."""
    d = latlong_directions(width, width // 2)
    picture = mix((0.03, 0.03, 0.035), (0.10, 0.11, 0.13), smooth_step(-0.2, 1.0, d[..., 1]))
    azimuth, height = np.degrees(np.arctan2(d[..., 0], d[..., 2])), np.degrees(np.arcsin(np.clip(d[..., 1], -1, 1)))
    for middle, wide, low, high, color in (
        (-65, 22, 12, 62, (6, 5.6, 5)),
        (75, 14, 5, 70, (2.2, 2.8, 4)),
        (170, 40, 30, 45, (4, 4, 4)),
    ):
        inside = np.abs((azimuth - middle + 180) % 360 - 180) < wide
        inside &= (height > low) & (height < high)
        picture = np.where(inside[..., None], color, picture)
    return picture


def checker(size: int, cells: int, a, b) -> np.ndarray:
    """cells x cells squares; colour `a` at the lower left."""
    s, t = plane(size, size)
    odd = (np.floor(s * cells) + np.floor(t * cells)) % 2
    return mix(a, b, odd)


def blocks(colors: np.ndarray, texels: int) -> np.ndarray:
    """Each colour of a (rows, columns, channels) array, rows from the top, as a square of texels."""
    return np.repeat(np.repeat(np.asarray(colors), texels, axis=0), texels, axis=1)


def wood(size: int, seed: int = 3, dark=(0.16, 0.07, 0.03), light=(0.48, 0.27, 0.12)) -> tuple[np.ndarray, np.ndarray]:
    """Boards: colour, and a roughness of one channel."""
    s, t = plane(size, size)
    board = np.floor(t * 4)
    shift = np.random.default_rng(seed).uniform(0, 1, 8)[board.astype(int) % 8]
    bent = noise(s, (t * 0.5 + shift) % 1.0, 4, seed, 3)
    rings = 0.5 + 0.5 * np.sin(2 * math.pi * (9 * t + 3.5 * bent + 5 * shift))
    fine = noise(s, (t * 8) % 1.0, 32, seed + 1, 2)
    tone = np.clip(0.65 * rings + 0.25 * fine + 0.5 * (shift - 0.5), 0, 1)
    gap = smooth_step(0.0, 0.015, np.minimum(t * 4 - board, 1 - (t * 4 - board)))
    return mix(dark, light, tone) * (0.25 + 0.75 * gap)[..., None], 0.35 + 0.3 * fine + 0.2 * (1 - gap)


def bricks(size: int, seed: int = 5) -> tuple[np.ndarray, np.ndarray]:
    """Colour and height 0 .. 1 of a brick wall."""
    s, t = plane(size, size)
    row = np.floor(t * 8)
    x = s * 4 + 0.5 * (row % 2)
    cell = (np.floor(x) % 4).astype(int)
    tone = np.random.default_rng(seed).uniform(0, 1, (8, 4))[row.astype(int) % 8, cell]
    edge = np.minimum(np.minimum(x % 1.0, 1 - x % 1.0) * 2, np.minimum((t * 8) % 1.0, 1 - (t * 8) % 1.0))
    rough = noise(s, t, 16, seed + 2, 4)
    height = smooth_step(0.03, 0.14, edge) * (0.75 + 0.25 * rough)
    color = mix((0.42, 0.40, 0.36), mix((0.36, 0.11, 0.06), (0.55, 0.24, 0.14), tone), smooth_step(0.04, 0.10, edge))
    return color * (0.8 + 0.4 * rough)[..., None], height


def normals_of(height: np.ndarray, strength: float) -> np.ndarray:
    """Tangent space normals of a height field that repeats, encoded to 0 .. 1; `strength` is its height in widths of
    the picture."""
    rows, columns = height.shape
    along_s = (np.roll(height, -1, 1) - np.roll(height, 1, 1)) * 0.5 * columns * strength
    along_t = (np.roll(height, 1, 0) - np.roll(height, -1, 0)) * 0.5 * rows * strength
    normal = np.stack([-along_s, -along_t, np.ones_like(height)], axis=-1)
    return 0.5 + 0.5 * normal / np.linalg.norm(normal, axis=-1, keepdims=True)


def leaf(size: int, hue: float = 0.0, seed: int = 1) -> np.ndarray:
    """A leaf with veins on nothing: RGBA, straight alpha, stem at the middle of the lower edge."""
    s, t = plane(size, size)
    across = np.abs(2 * s - 1)
    width = 0.92 * np.sin(math.pi * np.clip((t - 0.06) / 0.92, 0, 1)) ** 0.8 * (1 - 0.35 * t)
    width *= 1 - 0.10 * np.abs(np.sin(t * 36))
    blade = across < width
    stem = (across < 0.03) & (t < 0.3)
    veins = np.exp(-(((across * 0.55 - (t * 9) % 1.0 / 9 * 3) * 30) ** 2)) + np.exp(-((across * 28) ** 2))
    tone = noise(s, t, 8, seed, 3)
    green = mix((0.06 + 0.3 * hue, 0.22, 0.03), (0.16 + 0.5 * hue, 0.42 - 0.1 * hue, 0.06), tone)
    color = mix(green, (0.35 + 0.3 * hue, 0.5, 0.18), np.clip(0.6 * veins, 0, 0.6))
    color = np.where((stem & ~blade)[..., None], (0.25, 0.2, 0.08), color)
    return np.concatenate([color, (blade | stem).astype(float)[..., None]], axis=-1)


def bark(size: int, seed: int = 9) -> tuple[np.ndarray, np.ndarray]:
    """Colour and height of bark, its furrows along t."""
    s, t = plane(size, size)
    bend = noise(s, t, 4, seed, 3)
    furrow = noise((s + 0.06 * bend) % 1.0, (t * 0.25) % 1.0, 24, seed + 1, 3)
    height = smooth_step(0.3, 0.7, furrow)
    return mix((0.05, 0.035, 0.025), mix((0.22, 0.15, 0.10), (0.30, 0.27, 0.22), bend), height), height
