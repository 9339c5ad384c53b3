# SPDX-License-Identifier: Apache-2.0
"""Shapes and pictures that the sets are made of, as arrays of numpy. Lengths are metres, z is up."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

TAU = 2 * np.pi


class Shape(NamedTuple):
    """A polygon mesh whose faces have equally many corners; `st` is one pair a point."""

    points: np.ndarray
    faces: np.ndarray
    st: np.ndarray


def noise(rng, size: int, channels: int = 1, low: int = 4, fade: float = 0.55) -> np.ndarray:
    """Value noise that repeats, (size, size, channels) from 0 to 1: octaves from `low` cells a side to one a texel."""
    made = np.zeros((size, size, channels), np.float32)
    weight, cells = 1.0, low
    while True:
        cells = min(cells, size)
        made += weight * _enlarged(rng.random((cells, cells, channels), dtype=np.float32), size)
        if cells == size:
            break
        weight, cells = weight * fade, cells * 3
    made -= made.min(axis=(0, 1))
    return made / np.maximum(made.max(axis=(0, 1)), 1e-6)


def _enlarged(cells: np.ndarray, size: int) -> np.ndarray:
    """Bilinear, wrapping round."""
    count = len(cells)
    at = np.arange(size, dtype=np.float32) * (count / size)
    low = at.astype(np.int64)
    part = (at - low)[:, None, None]
    high = (low + 1) % count
    rows = cells[low] * (1 - part) + cells[high] * part
    part = part.reshape(1, -1, 1)
    return rows[:, low] * (1 - part) + rows[:, high] * part


def quads(rows: int, columns: int) -> np.ndarray:
    """Faces of a grid of (rows + 1) x (columns + 1) points, row by row."""
    first = np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)[None]
    return np.stack([first, first + 1, first + columns + 2, first + columns + 1], -1).reshape(-1, 4)


def sheet(xs: np.ndarray, ys: np.ndarray, height, scale: float = 1.0) -> Shape:
    """A height field over a grid that faces up; texture coordinates are metres by `scale`."""
    x, y = np.meshgrid(xs, ys)
    points = np.stack([x, y, height(x, y)], -1).reshape(-1, 3)
    return Shape(points, quads(len(ys) - 1, len(xs) - 1), np.stack([x, y], -1).reshape(-1, 2) * scale)


def box(x: float, y: float, z: float) -> Shape:
    """A box that stands on z = 0, with each side its own points and texture coordinates in metres."""
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * 0.5
    sides = []
    for axis, sign in ((0, 1), (0, -1), (1, 1), (1, -1), (2, 1), (2, -1)):
        u, v = ((1, 2), (2, 0), (0, 1))[axis]
        flat = corners if sign > 0 else corners[:, ::-1]
        side = np.empty((4, 3))
        side[:, axis], side[:, u], side[:, v] = 0.5 * sign, flat[:, 0], flat[:, 1]
        sides.append(side)
    points = np.concatenate(sides) * [x, y, z]
    across = np.where(np.repeat([1, 1, 0, 0, 0, 0], 4), points[:, 1], points[:, 0])
    along = np.where(np.repeat([1, 1, 1, 1, 0, 0], 4), points[:, 2], points[:, 1])
    return Shape(points + [0, 0, z / 2], np.arange(24).reshape(6, 4), np.stack([across, along + z / 2], -1))


def tube(path: np.ndarray, radii: np.ndarray, sides: int = 8) -> Shape:
    """A tube about a line of points, open at both ends."""
    along = np.gradient(path, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    aside = np.where(np.abs(along[:, 2:3]) > 0.9, [[1.0, 0, 0]], [[0, 0, 1.0]])
    u = np.cross(aside, along)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(along, u)
    turn = np.linspace(0, TAU, sides + 1)
    ring = np.cos(turn)[None, :, None] * u[:, None] + np.sin(turn)[None, :, None] * v[:, None]
    points = path[:, None] + ring * radii[:, None, None]
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    st = np.stack(np.broadcast_arrays(turn[None] / TAU, length[:, None]), -1)
    return Shape(points.reshape(-1, 3), quads(len(path) - 1, sides), st.reshape(-1, 2))


def lathe(profile: np.ndarray, sides: int = 48) -> Shape:
    """A surface of revolution about z; `profile` is radius and height, from the bottom up for normals that face out."""
    turn = np.linspace(0, TAU, sides + 1)
    points = np.stack([
        profile[:, :1] * np.cos(turn), profile[:, :1] * np.sin(turn), np.repeat(profile[:, 1:], sides + 1, 1)
    ], -1)
    st = np.stack(np.broadcast_arrays(turn[None] / TAU, np.linspace(0, 1, len(profile))[:, None]), -1)
    return Shape(points.reshape(-1, 3), quads(len(profile) - 1, sides), st.reshape(-1, 2))


def blob(rng, triangles: int, rough: float = 0.4, flat: float = 0.7) -> Shape:
    """A lump of about so many triangles and a radius of about 1."""
    rows = max(int((triangles / 4) ** 0.5), 4)
    polar, turn = np.meshgrid(np.linspace(np.pi, 0, rows + 1), np.linspace(0, TAU, 2 * rows + 1), indexing="ij")
    away = np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], -1)
    radius = np.ones_like(polar)
    for octave in range(7):
        for _ in range(3):
            wave = rng.normal(size=3) * 2.0**octave * 0.9
            radius += rough * 0.22 / 1.8**octave * np.sin(away @ wave + rng.uniform(0, TAU))
    points = away * radius[..., None] * [1, 1, flat]
    st = np.stack([turn / TAU * 3, polar / np.pi * 1.5], -1)
    return Shape(points.reshape(-1, 3), quads(rows, 2 * rows), st.reshape(-1, 2))


def card(width: float, height: float) -> Shape:
    """An upright card that faces -y, its foot at the origin."""
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    points = np.stack([(corners[:, 0] - 0.5) * width, 0 * corners[:, 0], corners[:, 1] * height], -1)
    return Shape(points, np.array([[0, 1, 2, 3]]), corners)


def joined(shapes: list[Shape]) -> Shape:
    """All in one mesh; their faces have equally many corners."""
    starts = np.cumsum([0] + [len(shape.points) for shape in shapes[:-1]])
    return Shape(
        np.concatenate([shape.points for shape in shapes]),
        np.concatenate([shape.faces + start for shape, start in zip(shapes, starts)]),
        np.concatenate([shape.st for shape in shapes]),
    )


def moved(shape: Shape, by=(0, 0, 0), scale=1.0) -> Shape:
    return shape._replace(points=shape.points * scale + np.asarray(by))


def turns(rng, count: int, tilt: float = 0.05) -> np.ndarray:
    """Quaternions (w, x, y, z): any angle about z, tilted a little."""
    angle = rng.uniform(0, TAU, count) / 2
    lean = rng.normal(size=(count, 2)) * tilt
    made = np.stack([np.cos(angle), lean[:, 0], lean[:, 1], np.sin(angle)], -1)
    return made / np.linalg.norm(made, axis=1, keepdims=True)


def any_turns(rng, count: int) -> np.ndarray:
    """Quaternions of all directions."""
    made = rng.normal(size=(count, 4))
    return made / np.linalg.norm(made, axis=1, keepdims=True)


def rotation(turn: np.ndarray) -> np.ndarray:
    """Quaternions (n, 4) as matrices (n, 3, 3) for column vectors."""
    w, x, y, z = np.moveaxis(turn, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)
