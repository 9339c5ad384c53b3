# SPDX-License-Identifier: Apache-2.0
"""Terminals of materials in two render contexts: each is that of MaterialX or, where that has none, the universal one.

MaterialX surfaces shine blue, universal ones green; nothing else gives light.
"""

from cases.case import Case

RED, GREEN, BLUE, BLACK = (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0)

CASES = [
    Case(
        "40_terminals_displacement",
        (4, 1),
        {(0, 0): BLUE, (1, 0): BLUE, (2, 0): GREEN},
        "cubes of half side a = 0.3 under Catmull-Clark rules: the limit of a face's middle is at 272/324 a = 0.252,"
        " that of an edge's middle at 790/1296 a = 0.183 in x and y, so the middle half of a cell is only filled by"
        " what is displaced by 0.15: to 0.402 and to 0.289 in x and y",
        inset=0.25,
        silent=True,
    ),
    Case(
        "40_terminals_combined",
        (6, 1),
        {(0, 0): GREEN, (1, 0): BLUE, (2, 0): BLUE, (3, 0): GREEN, (4, 0): BLUE, (5, 0): GREEN},
        "a quad that is displaced by 0.15 is in front of the red one at 0.1, any other is behind it. Surface and"
        " displacement of each context, m and u: Su Dm, Sm Du, both of both (D of u is 0), Su Du Dm (D of u is 0),"
        " Sm Su Du, Su Du",
        inset=0.25,
        silent=True,
    ),
    Case(
        "40_terminals_no_surface",
        (2, 1),
        {(0, 0): BLACK, (1, 0): BLACK},
        "displaced as above by Dm and by Du alone; without a light what has no surface is black",
        inset=0.25,
        front_end="scene_index",
    ),
    Case(
        "40_terminals_no_surface",
        (2, 1),
        {(0, 0): RED, (1, 0): RED},
        "UsdImaging's scene delegate hands over no material without a surface: nothing is displaced, and it is said",
        inset=0.25,
        front_end="legacy",
        variant="legacy",
        says=("does not exist, or has no surface that is read",),
    ),
]
