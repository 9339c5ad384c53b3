# SPDX-License-Identifier: Apache-2.0
"""What textures give outside of their images: MaterialX's address modes, `default`, `fallback`, UDIM sets.

`tex/quad.png` is red at the lower left, green at the lower right, magenta at the upper left, cyan at the upper right,
four texels each way to a quarter. Texture coordinates are constants, so lookups have no width.
"""

from cases.case import Case

DEFAULT = (0.2, 0.4, 0.6)
RED, GREEN, MAGENTA, YELLOW = (1, 0, 0), (0, 1, 0), (1, 0, 1), (1, 1, 0)

OUTSIDE = {
    (0, 0): DEFAULT,  # u = 1.25, constant along u
    (1, 0): DEFAULT,  # v = -0.25, constant along v
    (2, 0): GREEN,  # inside
    (3, 0): 0,  # no default is said: that of the nodedef
    (0, 1): DEFAULT,  # a tile that is not there
    (1, 1): 0.6,  # float
    (2, 1): DEFAULT,  # color4
    (3, 1): RED,  # tiledimage repeats
    (0, 2): DEFAULT,  # UsdUVTexture: a tile that is not there is its fallback
    (1, 2): YELLOW,  # tile 1012
    (2, 2): DEFAULT,  # no tile can be there
    (3, 2): 0,  # wrapS black is black, not the fallback
    (0, 3): DEFAULT,  # 0 times the scale, plus the bias
    (1, 3): DEFAULT,  # no file: the fallback, not scaled
    (2, 3): 0,  # useMetadata, and the file says nothing
    (3, 3): MAGENTA,  # clamped along t at the top
}

# The default is a texel as others are: where a lookup lies between it and the image, it is mixed in by the filter.
RIM = tuple(0.5 * a + 0.5 * b for a, b in zip(GREEN, DEFAULT))
CORNER = tuple(0.25 * a + 0.75 * b for a, b in zip(GREEN, DEFAULT))

BORDERS = {
    (0, 0): 0.6,  # float, v = 1.25, clamped along u
    (1, 0): (0.2, 0.4, 0),  # vector2, v = -0.25, periodic along u
    (2, 0): DEFAULT,  # vector3
    (3, 0): 0.8,  # w of a vector4
    (0, 1): 0.5,  # alpha of a color4
    (1, 1): DEFAULT,  # twice the default of half as much
    (2, 1): DEFAULT,  # the same of a file that is not there
    (3, 1): DEFAULT,  # and of a tile
    (0, 2): 0.4,  # a ramp from 0.2 to 0.6 is the default
    (1, 2): RIM,  # u = 1: half of the filter
    (2, 2): CORNER,  # and v = 0: three quarters of it
    (3, 2): GREEN,  # mirrored along u: 0.75
    (0, 3): RED,  # periodic along u: 0.25
    (1, 3): 0.5,  # opacity, whose default is 1, of a surface of 0.5
    (2, 3): GREEN,  # between tiles 1001 and 1002 there is no border
    (3, 3): GREEN,  # clamped
}

CASES = [
    Case(
        "15_outside_values", (4, 4), OUTSIDE, "constant coordinates: a texel, the default or the fallback", inset=0.125
    ),
    Case(
        "15_borders", (4, 4), BORDERS, "the default lies around the image as texels do, and what is made of texels is "
        "made of it", inset=0.125,
    ),
]  # fmt: skip
