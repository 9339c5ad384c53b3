# SPDX-License-Identifier: Apache-2.0
"""Writes Ptex files (Burley and Lacewell 2008; version 1 of the format) for meshes of any faces, without the renderer's
code."""

from __future__ import annotations

import pathlib
import struct
import zlib
from collections.abc import Callable, Sequence

import numpy as np

TYPES = {np.uint8: 0, np.uint16: 1, np.float16: 2, np.float32: 3}


def faces_of(mesh: Sequence[Sequence[int]]) -> list[tuple[int, int]]:
    """The Ptex faces of a mesh: number of its face, and its corner (-1 for a quad)."""
    return [
        (number, corner)
        for number, face in enumerate(mesh)
        for corner in ([-1] if len(face) == 4 else range(len(face)))
    ]


def adjacency(mesh: Sequence[Sequence[int]]) -> tuple[list[list[int]], list[list[int]]]:
    """Neighbours of each Ptex face along edges 0 to 3 (-1: none), and which of their edges those are."""
    first, halves = {}, {}
    for at, (number, _) in enumerate(faces_of(mesh)):
        first.setdefault(number, at)
    for number, face in enumerate(mesh):
        for k, vertex in enumerate(face):
            halves[vertex, face[(k + 1) % len(face)]] = (number, k)
    count = len(faces_of(mesh))
    faces, edges = [[-1] * 4 for _ in range(count)], [[0] * 4 for _ in range(count)]

    def link(face: int, edge: int, other: tuple[int, int]) -> None:
        faces[face][edge], edges[face][edge] = other

    for number, face in enumerate(mesh):
        n = len(face)
        for k, vertex in enumerate(face):
            begin = end = (-1, 0)
            if (found := halves.get((face[(k + 1) % n], vertex))) is not None:
                other, edge = found
                sides = len(mesh[other])
                begin = (first[other], edge) if sides == 4 else (first[other] + (edge + 1) % sides, 3)
                end = (first[other], edge) if sides == 4 else (first[other] + edge, 0)
            if n == 4:
                link(first[number], k, begin)
            else:
                here, after = first[number] + k, first[number] + (k + 1) % n
                link(here, 0, begin)
                link(here, 1, (after, 2))
                link(after, 3, end)
                link(after, 2, (here, 1))
    return faces, edges


def place(
    mesh: Sequence[Sequence[int]], points: np.ndarray, face: tuple[int, int], u: np.ndarray, v: np.ndarray
) -> np.ndarray:
    """The points at (u, v) of a Ptex face. Those of n-gons go linearly over both triangles at its diagonal, as they are
    drawn."""
    number, corner = face
    at = np.asarray(points, float)[list(mesh[number])]
    u, v = u[..., None], v[..., None]
    if corner < 0:
        return (1 - u) * (1 - v) * at[0] + u * (1 - v) * at[1] + u * v * at[2] + (1 - u) * v * at[3]
    middle, here = at.mean(axis=0), at[corner]
    after, before = (here + at[(corner + 1) % len(at)]) / 2, (here + at[corner - 1]) / 2
    side, far, near = np.where(u >= v, after, before), np.minimum(u, v), np.maximum(u, v)
    return here * (1 - near) + side * (near - far) + middle * far


def texels(
    mesh, points, size: Callable[[int], tuple[int, int]], color: Callable[[np.ndarray], np.ndarray]
) -> list[np.ndarray]:
    """For each Ptex face of 2^size texels, `color` of the places of its texels: (v, u, channel)."""
    out = []
    for number, face in enumerate(faces_of(mesh)):
        width, height = (1 << k for k in size(number))
        u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
        out.append(color(place(mesh, points, face, u, v)))
    return out


def write(path: pathlib.Path, mesh: Sequence[Sequence[int]], faces: Sequence[np.ndarray], alpha: int = -1) -> None:
    """Writes the texels of each Ptex face (v, u, channel), all of one type; sides are powers of two."""
    path.write_bytes(content(mesh, faces, alpha))


def content(mesh: Sequence[Sequence[int]], faces: Sequence[np.ndarray], alpha: int = -1) -> bytes:
    channels, kind = faces[0].shape[2], faces[0].dtype
    neighbours, edges = adjacency(mesh)
    infos, words, blocks, constants = b"", b"", b"", b""
    for at, (texels, (_, corner)) in enumerate(zip(faces, faces_of(mesh), strict=True)):
        height, width, _ = texels.shape
        packed = sum(edge << 2 * k for k, edge in enumerate(edges[at]))
        flags = 8 if corner >= 0 else 0
        infos += struct.pack("<bbBB4i", width.bit_length() - 1, height.bit_length() - 1, packed, flags, *neighbours[at])
        # Planes of channels, one behind the other.
        block = zlib.compress(np.ascontiguousarray(texels.transpose(2, 0, 1)).tobytes())
        words += struct.pack("<I", len(block) | 1 << 30)
        blocks += block
        constants += texels.mean(axis=(0, 1)).astype(kind).tobytes()
    infos, constants, words = zlib.compress(infos), zlib.compress(constants), zlib.compress(words)
    level = struct.pack("<QII", len(words) + len(blocks), len(words), len(faces))
    header = struct.pack(
        "<4sIIIiHHIIIIIIQII", b"Ptex", 1, 1, TYPES[kind.type], alpha, channels, 1, len(faces), 40, len(infos),
        len(constants), len(level), 4, len(words) + len(blocks), 0, 0,
    )
    assert len(header) == 64
    return header + bytes(40) + infos + constants + level + words + blocks
