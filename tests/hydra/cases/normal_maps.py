# SPDX-License-Identifier: Apache-2.0
"""Normals that MaterialX networks work out: ids of 1.38, object space, constants, programs, placements.

The sun shines along -(0.6, 0, 0.8) with an irradiance of pi at right angles on surfaces of albedo 0.5 in the plane
z = 0: a normal n gives 0.5 n . (0.6, 0, 0.8). `nx.png` is (204, 128, 230) / 255 everywhere, `nz.png`
(128, 128, 255) / 255. In row 0 u grows along x and v along y, in row 1 u along y and v along -x.
"""

from __future__ import annotations

import math

from cases.case import Case

LEAN = (0.6, 0.0, 0.8)
FLAT = (0.0, 0.0, 1.0)


def decoded(texel: tuple[int, int, int]) -> tuple[float, float, float]:
    x, y, z = (2 * value / 255 - 1 for value in texel)
    return x, y, z


def unit(n):
    size = math.hypot(*n)
    return tuple(v / size for v in n)


def lit(n) -> float:
    return 0.5 * max(0.0, sum(a * b for a, b in zip(unit(n), LEAN)))


def in_row(n, row: int):
    """What tangent space says, in the world."""
    x, y, z = n
    return (x, y, z) if row == 0 else (-y, x, z)


NX, NZ = decoded((204, 128, 230)), decoded((128, 128, 255))


def both(column: int, of) -> dict[tuple[int, int], float]:
    return {(column, row): of(row) for row in (0, 1)}


def mixed(row: int):
    """Half of the normal of the world, half of (0, 0, 1)."""
    return tuple(0.5 * a + 0.5 * b for a, b in zip(unit(in_row(NZ, row)), FLAT))


FORMS = {
    **both(0, lambda row: lit(in_row(NX, row))),  # ND_normalmap
    **both(1, lambda row: lit(NX)),  # its space is the object's, which is the world here
    **both(2, lambda row: lit(FLAT)),  # scale 0
    **both(3, lambda row: lit(in_row((0.5 * NX[0], 0.5 * NX[1], NX[2]), row))),  # scale 0.5
    **both(4, lambda row: lit(in_row(NX, row))),  # open_pbr_surface
    **both(5, lambda row: lit(in_row(NX, row))),  # gltf_pbr
    **both(6, lambda row: lit(LEAN)),  # a value of the world
    **both(7, lambda row: lit(LEAN)),  # a constant node
    **both(8, lambda row: lit(in_row(NX, row))),  # ND_normalmap_float
    **both(9, lambda row: lit(FLAT)),  # the surface's own, of the world
    **both(10, lambda row: lit(FLAT)),  # (0, 0, 1) for a UsdPreviewSurface
    **both(11, lambda row: lit(in_row(LEAN, row))),  # whose normals are those of tangent space
    **both(12, lambda row: lit(NX)),  # about a tangent and a normal that are said
    **both(13, lambda row: lit(in_row(NX, row))),  # gltf_normalmap
}

PROGRAMS = {
    **both(0, lambda row: lit(in_row(NZ, row))),
    **both(1, lambda row: lit(mixed(row))),
    **both(2, lambda row: lit(mixed(row))),
    **both(3, lambda row: lit(in_row(NZ, row))),  # normalize
    **both(4, lambda row: lit(in_row(NZ, row))),  # switch
    **both(5, lambda row: lit(mixed(row))),  # its normal is connected to the world's
    # A UsdPreviewSurface takes the normal of the world for one of tangent space.
    **both(6, lambda row: lit(in_row(unit(in_row(NZ, row)), row))),
    **both(7, lambda row: lit(in_row(unit(in_row(NZ, row)), row))),
    **both(8, lambda row: unit(NZ)[2]),  # facing ratio, seen along -z
    **both(9, lambda row: unit(NZ)[2]),
}

# (-0.6, 0, 0.8): turned half a turn about z, or with u along -x.
TURNED = lit((-0.6, 0.0, 0.8))

PLACED = {
    (0, 0): lit(LEAN),  # (0.6, 0.8, 0) of an object that is turned a quarter about x
    (1, 0): lit((0.3, 0.0, 0.8)),  # of an object twice as wide along x: normals are covectors
    (2, 0): lit(LEAN),  # of an object without texture coordinates
    (3, 0): lit(LEAN),  # a constant of the world, without texture coordinates
    (4, 0): TURNED,  # a program of tangent space, u mirrored
    (5, 0): lit((-NX[0], NX[1], NX[2])),  # a texture of it
    (6, 0): 0.8,  # facing ratio of (-0.6, 0, 0.8)
    (7, 0): lit(LEAN),  # a constant of the world, from behind
    (8, 0): lit(LEAN),  # a constant of a UsdPreviewSurface without textures
    (8, 1): TURNED,  # the same, u mirrored
    (0, 1): lit(LEAN),  # point instances
    (1, 1): TURNED,  # turned half a turn about z
    (2, 1): lit((0.6, 0.0, 1.6)),  # half as deep along z
    (3, 1): TURNED,  # native instances in each other, a quarter each
    (4, 1): lit((0.6, 0.0, 1.6)),  # transformnormal, of the same
    (5, 1): lit(LEAN),  # a height that falls by 12 along u: (12 / 16, 0, 1)
    (6, 1): lit(LEAN),  # the same as a colour, through a normal map of 1.38
    (7, 1): lit(LEAN),  # a UsdPreviewSurface reads 2 x - 1 as tangent space, however the object is turned
}

CASES = [
    Case("17_normalmap_forms", (14, 2), FORMS, "0.5 n . (0.6, 0, 0.8)", inset=0.125, samples=16),
    Case("19_normalmap_138_in_program", (10, 2), PROGRAMS, "0.5 n . (0.6, 0, 0.8)", inset=0.125, samples=16),
    Case("19_normals_placed", (9, 2), PLACED, "0.5 n . (0.6, 0, 0.8)", inset=0.125, samples=16),
]
