# SPDX-License-Identifier: Apache-2.0
"""Catmull-Clark refinement in numpy, step by step, as an answer that OpenSubdiv had no part in: all faces quads after
the first step, edges smooth or infinitely sharp, boundaries sharp (Catmull and Clark 1978; DeRose, Kass and Truong
1998, "Subdivision surfaces in character animation")."""

from __future__ import annotations

import collections

import numpy as np


def refine(points: np.ndarray, faces: list[list[int]], sharp: set[frozenset], levels: int):
    """Points, quads (n, 4) and the authored face of each quad."""
    points = np.asarray(points, dtype=np.float64)
    owners = list(range(len(faces)))
    for _ in range(levels):
        points, faces, owners, sharp = _step(points, faces, owners, sharp)
    return points, np.array(faces), np.array(owners)


def _step(points, faces, owners, sharp):
    edges: dict[frozenset, list[int]] = {}
    for number, face in enumerate(faces):
        for a, b in zip(face, np.roll(face, -1)):
            edges.setdefault(frozenset((int(a), int(b))), []).append(number)
    centres = np.array([points[list(face)].mean(axis=0) for face in faces])
    is_sharp = {edge: edge in sharp or len(sides) != 2 for edge, sides in edges.items()}
    middles, number_of = [], {}
    for edge, sides in edges.items():
        number_of[edge] = len(points) + len(faces) + len(middles)
        ends = points[list(edge)].sum(axis=0)
        middles.append(ends / 2 if is_sharp[edge] else (ends + centres[sides].sum(axis=0)) / 4)
    moved = _moved(points, faces, edges, is_sharp, centres)
    quads, new_owners = [], []
    for number, face in enumerate(faces):
        for k, corner in enumerate(face):
            ahead = number_of[frozenset((int(corner), int(face[(k + 1) % len(face)])))]
            behind = number_of[frozenset((int(corner), int(face[k - 1])))]
            quads.append([int(corner), ahead, len(points) + number, behind])
            new_owners.append(owners[number])
    halves = {frozenset((end, number_of[edge])) for edge in edges if edge in sharp for end in edge}
    return np.concatenate([moved, centres, np.array(middles)]), quads, new_owners, halves


def _moved(points, faces, edges, is_sharp, centres):
    at_point = collections.defaultdict(list)
    for edge in edges:
        for end in edge:
            at_point[end].append(edge)
    faces_at = collections.defaultdict(list)
    for number, face in enumerate(faces):
        for corner in face:
            faces_at[int(corner)].append(number)
    moved = points.copy()
    for point, around in at_point.items():
        creases = [edge for edge in around if is_sharp[edge]]
        # A corner: three creases and more, or the corner of a boundary (one face).
        if len(creases) > 2 or len(faces_at[point]) == 1:
            continue
        if len(creases) == 2:
            others = sum(points[next(iter(edge - {point}))] for edge in creases)
            moved[point] = (6 * points[point] + others) / 8
            continue
        n = len(around)
        middles = np.mean([points[list(edge)].mean(axis=0) for edge in around], axis=0)
        moved[point] = (centres[faces_at[point]].mean(axis=0) + 2 * middles + (n - 3) * points[point]) / n
    return moved
