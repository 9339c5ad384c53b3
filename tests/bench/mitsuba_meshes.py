# SPDX-License-Identifier: Apache-2.0
"""Meshes on their way to Mitsuba, which has polygons alone: triangles, Catmull-Clark subdivision, displacement, PLY.
Needs numpy."""

from __future__ import annotations

import pathlib

import numpy as np


def triangles(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners of fans, (n, 3) numbers into the face corners, and the face of each triangle."""
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    corners, faces = [np.zeros((0, 3), int)], [np.zeros(0, int)]
    for size in np.unique(counts):
        chosen = np.flatnonzero(counts == size)
        for k in range(1, size - 1):
            corners.append(starts[chosen, None] + [0, k, k + 1])
            faces.append(chosen)
    return np.concatenate(corners), np.concatenate(faces)


def smooth_normals(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Of points, from the areas of the triangles about them."""
    a, b, c = (points[faces[:, corner]] for corner in range(3))
    facing = np.cross(b - a, c - a)
    made = np.zeros_like(points)
    for corner in range(3):
        np.add.at(made, faces[:, corner], facing)
    return made / np.maximum(np.linalg.norm(made, axis=1, keepdims=True), 1e-30)


def subdivided(values, counts, indices, corners=None):
    """One step of Catmull-Clark: values of points (n, k), corners of faces, values of corners or None, which stay
    bilinear. Boundaries are edges and corners as USD has them unless authored otherwise; creases are smooth. Returns
    the same and, for each new face, the one that it is of."""
    count, faces = len(values), np.repeat(np.arange(len(counts)), counts)
    starts = np.cumsum(counts) - counts
    own = np.arange(len(indices))
    after, before = own + 1, own - 1
    after[starts + counts - 1], before[starts] = starts, starts + counts - 1
    ends = np.sort(np.stack([indices, indices[after]], 1), 1)
    edges, of = np.unique(ends[:, 0].astype(np.int64) * count + ends[:, 1], return_inverse=True)
    ends = np.stack([edges // count, edges % count], 1)
    middle, centre = values[ends].mean(1), np.add.reduceat(values[indices], starts) / counts[:, None]
    is_open = np.bincount(of, minlength=len(edges)) != 2
    beside = _sums(of, centre[faces], len(edges))
    of_edges = np.where(is_open[:, None], middle, middle / 2 + beside / 4)
    valence = np.bincount(ends.ravel(), minlength=count)
    around = np.bincount(indices, minlength=count)
    n = np.maximum(valence, 1)[:, None]
    mean_faces = _sums(indices, centre[faces], count) / np.maximum(around, 1)[:, None]
    mean_edges = _sums(ends.ravel(), np.repeat(middle, 2, 0), count) / n
    smooth = (mean_faces + 2 * mean_edges + (n - 3) * values) / n
    rim = ends[is_open]
    rims = np.bincount(rim.ravel(), minlength=count)
    along = 0.75 * values + _sums(rim.ravel(), values[rim[:, ::-1].ravel()], count) / 8
    is_rim = (rims == 2) & (around > 1)
    stays = ((rims > 0) & ~is_rim) | (valence == 0)
    of_points = np.where(stays[:, None], values, np.where(is_rim[:, None], along, smooth))
    made = np.concatenate([of_points, of_edges, centre])
    quads = np.stack([indices, count + of, count + len(edges) + faces, count + of[before]], 1)
    if corners is not None:
        whole = (np.add.reduceat(corners, starts) / counts[:, None])[faces]
        corners = np.stack([corners, (corners + corners[after]) / 2, whole, (corners + corners[before]) / 2], 1)
        corners = corners.reshape(-1, corners.shape[-1])
    return made, np.full(len(quads), 4), quads.ravel(), corners, faces


def _sums(where: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    return np.stack([np.bincount(where, values[:, column], count) for column in range(values.shape[1])], 1)


class Mesh:
    """Triangles of one material: points, normals or None, st or None, faces; a picture that moves them or None."""

    def __init__(self, points, normals, st, faces, material=None, height=None) -> None:
        self.points, self.normals, self.st, self.faces = points, normals, st, faces
        self.material, self.height = material, height

    def backs(self) -> Mesh:
        """The other side, a little behind: Mitsuba's emitters shine from one."""
        normals = smooth_normals(self.points, self.faces)
        edges = self.points[self.faces[:, 1]] - self.points[self.faces[:, 0]]
        gap = 1e-3 * float(np.median(np.linalg.norm(edges, axis=1)))
        turned = None if self.normals is None else -self.normals
        return Mesh(self.points - gap * normals, turned, self.st, self.faces[:, ::-1], self.material)

    def moved(self, place: np.ndarray) -> Mesh:
        linear = place[:3, :3]
        is_turned = np.linalg.det(linear) < 0
        normals = None if self.normals is None else self.normals @ np.linalg.inv(linear)
        if normals is not None:
            normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
        faces = self.faces[:, ::-1] if is_turned else self.faces
        return Mesh(self.points @ linear.T + place[:3, 3], normals, self.st, faces, self.material)

    def raised(self, heights: np.ndarray, to_uv: np.ndarray) -> Mesh:
        """Points moved along their normals by a picture of one channel, row 0 at t = 0, that repeats; bilinear, of
        means as wide as the points are apart."""
        at = self.st @ to_uv[:2, :2].T + to_uv[:2, 2]
        steps = np.abs(at[self.faces[:, 1]] - at[self.faces[:, 0]]) * heights.shape[1::-1]
        apart = float(np.median(steps.max(1)))
        while apart >= 2 and min(heights.shape) > 1 and not any(side % 2 for side in heights.shape):
            heights = heights.reshape(heights.shape[0] // 2, 2, heights.shape[1] // 2, 2).mean((1, 3))
            apart /= 2
        size = np.array(heights.shape[1::-1])
        at = at * size - 0.5
        low = np.floor(at).astype(int)
        part = at - low
        pick = lambda x, y: heights[(low[:, 1] + y) % size[1], (low[:, 0] + x) % size[0]]
        mix = lambda y: pick(0, y) * (1 - part[:, 0]) + pick(1, y) * part[:, 0]
        height = mix(0) * (1 - part[:, 1]) + mix(1) * part[:, 1]
        points = self.points + height[:, None] * self.normals
        return Mesh(points, smooth_normals(points, self.faces), self.st, self.faces)

    def write(self, path: pathlib.Path) -> None:
        """Binary PLY."""
        parts = [("xyz", self.points), (("nx", "ny", "nz"), self.normals), ("uv", self.st)]
        parts = [(names, values) for names, values in parts if values is not None]
        names = [name for group, _ in parts for name in group]
        table = np.concatenate([values for _, values in parts], 1).astype("<f4")
        listed = np.empty(len(self.faces), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
        listed["count"], listed["corners"] = 3, self.faces
        head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(table)}"]
        head += [f"property float {name}" for name in names]
        head += [f"element face {len(listed)}", "property list uchar int vertex_indices", "end_header"]
        with open(path, "wb") as file:
            file.write(("\n".join(head) + "\n").encode())
            file.write(table.tobytes())
            file.write(listed.tobytes())
