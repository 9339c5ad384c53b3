# SPDX-License-Identifier: Apache-2.0
"""Procedural plants and stones for the forest: plain polygon soups with colours, made with numpy.

Every maker takes a numpy Generator and returns a Soup. Units are metres, y is up, the foot of the thing is at the
origin. Same generator state, same soup, bit for bit.
"""

from __future__ import annotations

import dataclasses

import numpy as np


@dataclasses.dataclass
class Soup:
    """A polygon mesh: points, faces of any size, one colour per face ("uniform")."""

    points: list = dataclasses.field(default_factory=list)
    counts: list = dataclasses.field(default_factory=list)
    indices: list = dataclasses.field(default_factory=list)
    colors: list = dataclasses.field(default_factory=list)
    size: int = 0

    def add(self, points: np.ndarray, faces: np.ndarray, colors: np.ndarray) -> None:
        """Adds (n, 3) points, (f, k) faces with k corners each and (f, 3) or (3,) linear colours."""
        faces = np.asarray(faces, dtype=np.int64)
        self.points.append(np.asarray(points, dtype=np.float64))
        self.counts.append(np.full(len(faces), faces.shape[1], dtype=np.int32))
        self.indices.append((faces + self.size).reshape(-1).astype(np.int32))
        self.colors.append(np.broadcast_to(np.asarray(colors, dtype=np.float64), (len(faces), 3)))
        self.size += len(points)

    def arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Points (f32), face counts, face indices, face colours (f32) as contiguous arrays."""
        return (
            np.concatenate(self.points).astype(np.float32),
            np.concatenate(self.counts),
            np.concatenate(self.indices),
            np.clip(np.concatenate(self.colors), 0.0, 1.0).astype(np.float32),
        )

    def triangle_count(self) -> int:
        return int(sum((counts - 2).sum() for counts in self.counts))


def rgb(text: str) -> np.ndarray:
    """Linear colour of an sRGB hex triple such as "7a5230"."""
    srgb = np.array([int(text[i : i + 2], 16) for i in (0, 2, 4)]) / 255.0
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def tube(soup: Soup, path: np.ndarray, radii: np.ndarray, sides: int, colors: np.ndarray) -> None:
    """A tube of quads along `path` (n, 3) with a radius per point and a colour per segment, closed by a point."""
    path = np.asarray(path, dtype=np.float64)
    along = _unit(np.gradient(path, axis=0))
    across = _unit(np.cross(along, [0.37, 0.11, 0.92]))
    third = np.cross(along, across)
    angle = np.arange(sides) * (2 * np.pi / sides)
    ring = across[:, None] * np.cos(angle)[None, :, None] + third[:, None] * np.sin(angle)[None, :, None]
    points = (path[:, None] + ring * np.asarray(radii)[:, None, None]).reshape(-1, 3)
    row, side = np.meshgrid(np.arange(len(path) - 1), np.arange(sides), indexing="ij")
    a, b = row * sides + side, row * sides + (side + 1) % sides
    quads = np.stack([a, a + sides, b + sides, b], axis=-1).reshape(-1, 4)
    soup.add(points, quads, np.repeat(np.broadcast_to(colors, (len(path) - 1, 3)), sides, axis=0))


def icosphere(level: int) -> tuple[np.ndarray, np.ndarray]:
    """Unit icosphere: points and triangles, each level multiplies the triangles by four."""
    golden = (1 + 5**0.5) / 2
    faces = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6)]
    faces += [(7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10)]
    faces += [(8, 6, 7), (9, 8, 1)]
    base = [(-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0)]
    base += [(0, -1, golden), (0, 1, golden), (0, -1, -golden), (0, 1, -golden)]
    base += [(golden, 0, -1), (golden, 0, 1), (-golden, 0, -1), (-golden, 0, 1)]
    points = [tuple(point) for point in _unit(np.array(base, dtype=np.float64))]
    for _ in range(level):
        middle: dict[tuple[int, int], int] = {}

        def halfway(i: int, j: int) -> int:
            key = (min(i, j), max(i, j))
            if key not in middle:
                middle[key] = len(points)
                points.append(tuple(_unit(np.add(points[i], points[j]))))
            return middle[key]

        split = []
        for a, b, c in faces:
            ab, bc, ca = halfway(a, b), halfway(b, c), halfway(c, a)
            split += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        faces = split
    return np.array(points), np.array(faces)


def _shade(rng: np.random.Generator, count: int, palette: list[str], spread: float) -> np.ndarray:
    """`count` colours picked from a palette, each a little lighter or darker."""
    picks = np.array([rgb(color) for color in palette])[rng.integers(0, len(palette), count)]
    return picks * np.exp(rng.normal(0.0, spread, (count, 1)))


def leaves(
    soup: Soup, rng: np.random.Generator, centres: np.ndarray, outward: np.ndarray, size: float, colors: np.ndarray
) -> None:
    """One bent leaf card (two triangles over a spine) per centre, roughly facing outward."""
    count = len(centres)
    normal = _unit(outward + rng.normal(0.0, 0.55, (count, 3)))
    spine = _unit(np.cross(normal, rng.normal(0.0, 1.0, (count, 3))))
    side = np.cross(normal, spine)
    length = size * np.exp(rng.normal(0.0, 0.25, (count, 1)))
    tip, root = centres + spine * length, centres - spine * length
    droop = normal * length * 0.35
    left, right = centres + side * length * 0.62 - droop, centres - side * length * 0.62 - droop
    points = np.stack([root, right, tip, left], axis=1).reshape(-1, 3)
    first = np.arange(count)[:, None] * 4
    faces = np.concatenate([first + [0, 1, 2], first + [0, 2, 3]], axis=1).reshape(-1, 3)
    soup.add(points, faces, np.repeat(colors, 2, axis=0))


def _trunk(
    soup: Soup, rng: np.random.Generator, height: float, radius: float, bark: list[str], lean: float = 0.04
) -> np.ndarray:
    steps = 7
    up = np.linspace(0.0, 1.0, steps)
    wander = np.cumsum(rng.normal(0.0, lean, (steps, 2)), axis=0) * height * up[:, None]
    path = np.stack([wander[:, 0], up * height - 0.25, wander[:, 1]], axis=1)
    flare = 1.0 + 0.7 * np.exp(-up * 14.0)
    tube(soup, path, radius * flare * (1.0 - 0.75 * up), 7, _shade(rng, steps - 1, bark, 0.12))
    return path


def conifer(rng: np.random.Generator, height: float, spread: float, palette: list[str]) -> Soup:
    """A spruce or fir: drooping whorls of branches, each branch a bent strip of needles."""
    soup = Soup()
    _trunk(soup, rng, height + 0.25, height * 0.016 + 0.04, ["4a3728", "57412f", "3e2f24"], lean=0.004)
    tiers = 21
    for tier in range(tiers):
        level = tier / (tiers - 1)
        y = height * (0.10 + 0.88 * level)
        reach = spread * (1.0 - level) ** 0.85 * rng.uniform(0.85, 1.1) + 0.06 * spread
        branches = int(round(15 - 7 * level))
        angle = (np.arange(branches) + rng.uniform()) * (2 * np.pi / branches) + rng.normal(0.0, 0.13, branches)
        length = reach * np.exp(rng.normal(0.0, 0.14, branches))
        out = np.stack([np.cos(angle), np.zeros(branches), np.sin(angle)], axis=1)
        side = np.stack([-out[:, 2], np.zeros(branches), out[:, 0]], axis=1)
        rise = height * 0.035 * (level - 0.35)
        # Neighbours hang at different heights, so that whorls do not look like plates.
        lift = height * 0.9 / tiers * rng.uniform(-0.6, 0.6, (branches, 1)) * (1.0 - level)
        root = np.array([0.0, y, 0.0]) + out * 0.02 + np.array([0.0, 1.0, 0.0]) * lift
        middle = root + out * (0.55 * length)[:, None] + [0.0, rise - 0.06 * reach, 0.0]
        tip = root + out * length[:, None] + np.stack([0 * length, rise - 0.36 * length, 0 * length], axis=1)
        width = (0.25 * length)[:, None]
        sag = np.array([0.0, -0.15, 0.0]) * length[:, None]
        points = np.stack([root, middle + side * width + sag, middle, middle - side * width + sag, tip], axis=1)
        first = np.arange(branches)[:, None] * 5
        faces = np.concatenate([first + f for f in ([0, 1, 2], [0, 2, 3], [2, 1, 4], [2, 4, 3])], axis=1)
        tone = _shade(rng, branches, palette, 0.16) * (0.72 + 0.5 * level)
        colors = np.repeat(tone[:, None], 4, axis=1) * np.array([0.75, 0.75, 1.2, 1.2])[None, :, None]
        soup.add(points.reshape(-1, 3), faces.reshape(-1, 3), colors.reshape(-1, 3))
    return soup


def broadleaf(
    rng: np.random.Generator, height: float, spread: float, palette: list[str], bark: list[str], cards: int = 1500
) -> Soup:
    """A tree with a crown of leaf cards on a cluster of blobs, carried by a few branches."""
    soup = Soup()
    path = _trunk(soup, rng, height * 0.62, height * 0.022 + 0.03, bark)
    top = path[-1]
    blobs = 11
    centres, radii = [], []
    for blob in range(blobs):
        angle, out = 2.4 * blob + rng.uniform(0, 0.8), spread * 0.62 * np.sqrt((blob + 0.3) / blobs)
        lift = height * (0.80 - 0.30 * (out / spread) ** 2 + rng.uniform(-0.13, 0.10))
        centres.append([np.cos(angle) * out, lift, np.sin(angle) * out])
        radii.append(spread * rng.uniform(0.30, 0.47))
        if blob % 2 == 0:
            joint = top * [1, 0, 1] + [0, height * rng.uniform(0.32, 0.55), 0]
            bend = (joint + centres[-1]) / 2 + [0, -0.03 * height, 0]
            tube(soup, np.array([joint, bend, centres[-1]]), height * np.array([0.010, 0.007, 0.002]), 5, rgb(bark[0]))
    centres, radii = np.array(centres), np.array(radii)
    pick = rng.integers(0, blobs, cards)
    outward = _unit(rng.normal(0.0, 1.0, (cards, 3)) * [1.0, 0.9, 1.0] + [0.0, 0.25, 0.0])
    points = centres[pick] + outward * radii[pick][:, None] * rng.uniform(0.72, 1.04, (cards, 1)) * [1.0, 0.78, 1.0]
    crown = points - [0.0, height * 0.66, 0.0]
    light = 0.78 + 0.34 * np.clip(crown[:, 1:2] / (height * 0.33), -1.0, 1.0)
    leaves(
        soup, rng, points, _unit(crown + outward * spread * 0.5), 0.052 * spread + 0.05,
        _shade(rng, cards, palette, 0.17) * light,
    )
    return soup


def bush(rng: np.random.Generator, height: float, spread: float, palette: list[str], cards: int = 420) -> Soup:
    """A shrub: twigs and a dome of leaf cards."""
    soup = Soup()
    for twig in range(6):
        angle = 2 * np.pi * twig / 6 + rng.uniform(0, 0.7)
        end = np.array([np.cos(angle) * spread * 0.6, height * 0.7, np.sin(angle) * spread * 0.6])
        tube(
            soup, np.array([[0, -0.1, 0], end * [0.4, 0.6, 0.4], end]), np.array([0.03, 0.02, 0.006]), 4, rgb("4b3a2a")
        )
    outward = _unit(rng.normal(0.0, 1.0, (cards, 3)) * [1, 0.8, 1] + [0.0, 0.35, 0.0])
    lumps = 1.0 + 0.22 * np.sin(5 * outward[:, :1] + 2.0) * np.cos(4 * outward[:, 2:])
    points = outward * [spread, height * 0.6, spread] * lumps * rng.uniform(0.6, 1.0, (cards, 1)) + [
        0, height * 0.42, 0
    ]
    points[:, 1] = np.maximum(points[:, 1], 0.03)
    light = 0.7 + 0.5 * np.clip(points[:, 1:2] / height, 0.0, 1.0)
    leaves(soup, rng, points, outward, 0.09 * spread + 0.02, _shade(rng, cards, palette, 0.16) * light)
    return soup


def tuft(rng: np.random.Generator, height: float, blades: int, palette: list[str]) -> Soup:
    """Tall grass or fern: bent blades from one foot."""
    soup = Soup()
    angle = rng.uniform(0, 2 * np.pi, blades)
    out = np.stack([np.cos(angle), np.zeros(blades), np.sin(angle)], axis=1)
    side = np.stack([-out[:, 2], np.zeros(blades), out[:, 0]], axis=1) * 0.022
    length = height * np.exp(rng.normal(0.0, 0.25, (blades, 1)))
    lean = rng.uniform(0.15, 0.95, (blades, 1))
    foot = out * rng.uniform(0.0, 0.16, (blades, 1)) - [0.0, 0.04, 0.0]
    knee = foot + out * length * lean * 0.35 + np.array([0.0, 0.62, 0.0]) * length
    tip = foot + out * length * lean + np.array([0.0, 1.0, 0.0]) * length * (1.05 - 0.55 * lean)
    points = np.stack([foot - side, foot + side, knee + side, knee - side, tip], axis=1).reshape(-1, 3)
    first = np.arange(blades)[:, None] * 5
    colors = _shade(rng, blades, palette, 0.15)
    soup.add(points, first + [0, 1, 2, 3], colors * 0.8)
    soup.add(points, first + [3, 2, 4], colors * 1.15)
    return soup


def rock(rng: np.random.Generator, radius: float, level: int, palette: list[str]) -> Soup:
    """A boulder: an icosphere cut by random planes and roughened."""
    soup = Soup()
    points, faces = icosphere(level)
    for _ in range(9):
        plane = _unit(rng.normal(0.0, 1.0, 3))
        excess = np.maximum(points @ plane - rng.uniform(0.62, 0.86), 0.0)
        points = points - excess[:, None] * plane
    points = points * (1.0 + 0.035 * rng.normal(0.0, 1.0, (len(points), 1)))
    points = points * radius * np.array([rng.uniform(0.9, 1.3), rng.uniform(0.55, 0.8), rng.uniform(0.8, 1.1)])
    points[:, 1] += radius * 0.22
    height = points[faces].mean(axis=1)[:, 1:2] / radius
    tone = _shade(rng, len(faces), palette, 0.05)
    moss = np.clip((height - 0.55) * 2.2 + rng.normal(0.0, 0.12, height.shape), 0.0, 0.75)
    soup.add(points, faces, tone * (1 - moss) + rgb("5d6434") * moss)
    return soup


def log(rng: np.random.Generator, length: float, radius: float) -> Soup:
    """A fallen trunk with a few broken branches."""
    soup = Soup()
    steps = np.linspace(-0.5, 0.5, 9)
    path = np.stack([steps * length, radius * 0.75 + 0.05 * np.sin(5 * steps), 0.2 * np.sin(3 * steps)], axis=1)
    tube(soup, path, radius * (1.0 - 0.35 * (steps + 0.5)), 10, _shade(rng, 8, ["5a4634", "6a5540", "4c4a2c"], 0.1))
    for at in (-0.2, 0.1, 0.33):
        foot = np.array([at * length, radius, 0.0])
        end = foot + np.array([0.25, rng.uniform(0.5, 0.9), rng.uniform(-0.6, 0.6)]) * radius * 4
        tube(soup, np.array([foot, (foot + end) / 2, end]), radius * np.array([0.22, 0.16, 0.08]), 5, rgb("4f3d2d"))
    return soup


def all_sixteen(seed: int) -> dict[str, Soup]:
    """The sixteen prototypes by name; the name's first part is the kind."""
    rng = np.random.default_rng(seed)
    dark, blue = ["1f3d22", "28482a", "1b3520", "31502c"], ["2d4a3c", "35564a", "29443a"]
    gold = ["c98a1b", "d79f2c", "b9771a", "dcb04a"]
    orange = ["b9521a", "c8641f", "a2431a", "cf7b2b"]
    green = ["5f7a2a", "6f8733", "4f6d27", "83923c"]
    red = ["8f2c1c", "a33a20", "7a2419"]
    grey_bark, white_bark = ["5b4a3b", "675445", "4d3f33"], ["cfc9bb", "b9b2a4", "8f897c", "ddd8cb"]
    return {
        "conifer_tall": conifer(rng, 19.0, 3.3, dark),
        "conifer_wide": conifer(rng, 14.0, 3.6, dark),
        "conifer_blue": conifer(rng, 12.0, 2.7, blue),
        "conifer_young": conifer(rng, 5.5, 1.6, dark + ["3d5c2e"]),
        "broadleaf_green": broadleaf(rng, 11.0, 4.0, green, grey_bark),
        "broadleaf_gold": broadleaf(rng, 10.0, 3.6, gold, grey_bark),
        "broadleaf_orange": broadleaf(rng, 9.0, 3.5, orange, grey_bark),
        "broadleaf_birch": broadleaf(rng, 12.0, 2.5, gold + ["c7b23e", "b5a83a"], white_bark, cards=1100),
        "broadleaf_maple": broadleaf(rng, 7.5, 3.0, red + orange[:1], grey_bark, cards=1200),
        "bush_green": bush(rng, 1.3, 1.0, green + dark[:1]),
        "bush_red": bush(rng, 1.0, 0.85, red + ["9a5a22"]),
        "bush_low": bush(rng, 0.6, 0.9, ["6d6b2c", "7d7430", "59622a"], cards=300),
        "tuft_grass": tuft(rng, 0.75, 90, ["a89a4a", "b8a552", "8d8f3e", "c2b06a"]),
        "tuft_fern": tuft(rng, 0.65, 60, ["7d7a2c", "9a6f28", "66732b"]),
        "rock_boulder": rock(rng, 1.0, 3, ["7d7a74", "8b877f", "6d6a66"]),
        "rock_log": log(rng, 5.5, 0.32),
    }
