# SPDX-License-Identifier: Apache-2.0
"""Surfaces that textures cut out: in what share they are there, from near and far.

The red of `tex/quad.png` is 1 on the left four of eight texels and 0 on the right ones; between their centres it is
linear. So 0.75 and more has half of the picture less a quarter of a texel on either side, 0.25 and more as much over.
Each column repeats the picture eight times as often as the one before: once to 32 pixels, and in the last one 16 times
to a pixel.
"""

from cases.case import Case

SHARES = (3.5 / 8, 4.5 / 8, 0.5)

CASES = [
    Case(
        "48_cutout_distances",
        (4, 3),
        {(x, y): share for y, share in enumerate(SHARES) for x in range(4)},
        "a threshold applies to what a texture is, not to its mean over a pixel",
        relative=1.5e-2,
        pixels=32,
        samples=128,
        covers=True,
    )
]
