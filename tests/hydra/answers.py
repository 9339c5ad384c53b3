# SPDX-License-Identifier: Apache-2.0
"""Irradiance that lights of UsdLux give a floor, in f64: closed forms, and quadrature over the light for those that
have none.

Points are (..., 3) arrays on the plane y = 0 facing up; nothing is in the way. `test_answers.py` checks them against
each other.
"""

from __future__ import annotations

import math

import numpy as np

UP = np.array([0.0, 1.0, 0.0])


def floor_points(size: int, width: float = 2.0, over: int = 2) -> np.ndarray:
    """Points seen from straight above with -z up in the picture, rows bottom-up; `over` x `over` points a pixel: (size,
    size, over^2, 3)."""
    at = lambda sign: sign * ((np.arange(size * over) + 0.5) / (size * over) - 0.5) * width
    x, z = np.meshgrid(at(1), at(-1))
    points = np.stack([x, np.zeros_like(x), z], axis=-1).reshape(size, over, size, over, 3)
    return points.transpose(0, 2, 1, 3, 4).reshape(size, size, over * over, 3)


def polygon(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Lambert's formula: irradiance per radiance of a polygon wholly above the floor, shining to the side from which
    its corners run clockwise.

    J. H. Lambert, Photometria (1760); sum over edges of the angle they span times the floor's share of the edge's
    plane.
    """
    total = np.zeros(points.shape[:-1])
    for a, b in zip(corners, np.roll(corners, -1, axis=0)):
        to_a, to_b = a - points, b - points
        cross = np.cross(to_a, to_b)
        length = np.linalg.norm(cross, axis=-1)
        angle = np.arctan2(length, (to_a * to_b).sum(axis=-1))
        total += angle * (cross @ UP) / np.where(length > 0, length, 1.0)
    return np.abs(total) / 2


def disk(points: np.ndarray, center, radius: float) -> np.ndarray:
    """A disk parallel to the floor (Howell, A Catalog of Radiation Heat Transfer Configuration Factors, B-13)."""
    offset = np.hypot(points[..., 0] - center[0], points[..., 2] - center[2])
    a, r2, h2 = np.maximum(offset, 1e-9), radius**2, center[1] ** 2
    z = a**2 + h2 + r2
    return math.pi / 2 * (1 - (a**2 + h2 - r2) / np.sqrt(z**2 - 4 * r2 * a**2))


def ball(points: np.ndarray, center, radius: float) -> np.ndarray:
    """A ball wholly above the horizon: pi (r / d)^2 cos."""
    to = np.asarray(center) - points
    distance = np.linalg.norm(to, axis=-1)
    return math.pi * (radius / distance) ** 2 * to[..., 1] / distance


def quadrature(
    points: np.ndarray, places: np.ndarray, normals: np.ndarray, areas: np.ndarray, shape=None
) -> np.ndarray:
    """The sum over small pieces of a light; `shape(cosine)` scales what leaves at an angle to the light's axis -y.
    Pieces behind either side give nothing."""
    total = np.zeros(points.shape[:-1])
    for place, normal, area in zip(places, normals, areas):
        to = place - points
        square = (to * to).sum(axis=-1)
        distance = np.sqrt(square)
        at_light = -(to @ normal) / distance
        gain = np.maximum(to[..., 1] / distance, 0) * np.maximum(at_light, 0) * area / square
        total += gain if shape is None else gain * shape(to[..., 1] / distance)
    return total


def rect_pieces(matrix: np.ndarray, width: float, height: float, count: int = 40):
    """Places, normals, areas of a rectangle that shines along -z of `matrix` (rows, as USD has it)."""
    step = (np.arange(count) + 0.5) / count - 0.5
    u, v = np.meshgrid(step * width, step * height)
    local = np.stack([u.ravel(), v.ravel(), np.zeros(u.size)], axis=1)
    x, y = matrix[0, :3], matrix[1, :3]
    cross = np.cross(x, y)
    normal = -cross / np.linalg.norm(cross) * np.sign(np.linalg.det(matrix[:3, :3]))
    return (
        local @ matrix[:3, :3] + matrix[3, :3], np.broadcast_to(normal, local.shape),
        np.full(len(local), np.linalg.norm(cross) * width * height / count**2),
    )


def disk_pieces(center, radius: float, rings: int = 8, sides: int = 24):
    """A disk that faces down."""
    r = radius * np.sqrt((np.arange(rings) + 0.5) / rings)
    a = 2 * math.pi * (np.arange(sides) + 0.5) / sides
    r, a = (m.ravel() for m in np.meshgrid(r, a))
    places = np.asarray(center) + np.stack([r * np.cos(a), np.zeros_like(r), r * np.sin(a)], axis=1)
    return places, np.broadcast_to(-UP, places.shape), np.full(len(places), math.pi * radius**2 / len(places))


def tube_pieces(matrix: np.ndarray, length: float, radius: float, along: int = 64, around: int = 96):
    """The mantle of a cylinder along x of `matrix` (no ends: UsdLux's cylinders do not shine there)."""
    x, a = np.meshgrid(
        ((np.arange(along) + 0.5) / along - 0.5) * length, 2 * math.pi * (np.arange(around) + 0.5) / around
    )
    x, a = x.ravel(), a.ravel()
    normal = np.stack([np.zeros_like(a), np.cos(a), np.sin(a)], axis=1)
    places = np.stack([x, radius * np.cos(a), radius * np.sin(a)], axis=1)
    return (
        places @ matrix[:3, :3] + matrix[3, :3], normal @ matrix[:3, :3],
        np.full(len(places), 2 * math.pi * radius * length / len(places)),
    )


def cone(angle: float, softness: float = 0.0, focus: float = 0.0):
    """UsdLux's shaping: 1 - smoothstep(angle (1 - softness), angle, theta), times cos^focus."""
    outer, inner = math.radians(angle), math.radians(angle) * (1 - softness)

    def shape(cosine):
        theta = np.arccos(np.clip(cosine, -1, 1))
        t = np.clip((theta - inner) / max(outer - inner, 1e-12), 0, 1)
        return (1 - t * t * (3 - 2 * t)) * np.maximum(cosine, 0) ** focus

    return shape


def smooth_pixels(values: np.ndarray, limit: float = 0.05) -> np.ndarray:
    """Pixels whose points (last axis) and neighbours differ by less than `limit` of the largest value: no edge runs
    there."""
    steady = np.ptp(values, axis=-1) < limit * values.max()
    mean = values.mean(axis=-1)
    for axis in (0, 1):
        for shift in (1, -1):
            steady &= np.abs(np.roll(mean, shift, axis) - mean) < 2 * limit * values.max()
    steady[[0, -1]], steady[:, [0, -1]] = False, False
    return steady
