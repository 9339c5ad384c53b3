# SPDX-License-Identifier: Apache-2.0
"""Solids of revolution, round items crossed by partial opacity, lines without widths, forms of displayColor.

The sky is 1 and seen. What is black shows 1 minus its share of the cell, whatever else is in the scene; a surface of
opacity a takes the share a of that, and a closed one 1 - (1 - a)^2, since every ray crosses it twice.
"""

from math import pi

from cases.case import Case

BLACK = """
for prim in stage.Traverse():
    if prim.IsA(UsdGeom.Gprim):
        UsdGeom.Gprim(prim).CreateDisplayColorAttr([(0, 0, 0)])
"""
MODEL = """
UsdGeom.ModelAPI(stage.GetPrimAtPath("/World/m")).CreateModelDrawModeColorAttr((0, 0, 0))
"""
TWICE = 1 - (1 - 0.4) ** 2
BALL = pi * 0.4**2


def crossed(areas, y=0, opacity=TWICE):
    """Cells of a row of black things with these areas, by what their opacity takes."""
    return {(x, y): 1 - area * opacity for x, area in enumerate(areas)}


# Sphere, capsule along x, cylinder and cone along the view, cube, point.
SHAPES = [BALL, pi * 0.2**2 + 0.4 * 0.4, BALL, BALL, 0.8**2, BALL]
SOLIDS = [
    pi * 0.4 * 0.2,  # a sphere of half the height
    0.4 * 0.6,  # a cylinder from the side
    0.3 * 0.8,  # a cone from the side
    pi / 2 * (0.3**2 + 0.15**2) + 0.4 * 0.45,  # half balls and what is between them
    0.6 * (0.4 + 0.2),  # a cylinder of two radii from the side
    pi * 0.3**2,  # signs do not count
    0,  # of no size
    pi * 0.2**2 + 0.4 * 0.4,
]
LAST = [BALL, 0.3 * 0.8, 0.4 * 0.4 + pi * 0.2**2, BALL, BALL, BALL, 0, 0]

# 15 pixels a unit are seen; widths go in half powers of two, so a pixel is 1 / 16.
LINE = 1 / 16
EIGHT = 8 * (0.6 * LINE + pi / 4 * LINE**2)
DOTS = 49 * pi / 4 * LINE**2
BOX = 4 * 0.6 * LINE - (4 - pi) / 4 * LINE**2

QUAD = 0.9**2


def quad(color, opacity=1.0):
    """A quad under the sky, all of which it sees."""
    return [1 - QUAD * opacity * (1 - c) for c in color]


COLOR = (0.2, 0.4, 0.6)
PLAIN, GREY, THIN = quad(COLOR), quad((0.18, 0.18, 0.18)), quad(COLOR, 0.25)
FORMS = {(x, y): PLAIN for x in range(5) for y in range(3)}
FORMS.update({(2, 2): GREY, (3, 2): GREY, (3, 1): THIN, (4, 1): THIN, (0, 2): THIN})
# UsdImaging's data sources read the schema's type alone: they have no value for another one.
UNREAD = {(1, 0): GREY, (2, 0): GREY, (3, 0): GREY, (4, 1): PLAIN, (0, 2): PLAIN}

CASES = [
    Case(
        "38_sphere_capsule",
        (6, 2),
        crossed(SHAPES, 0, 1) | crossed(SHAPES, 1),
        "areas of the shapes, made black; in the upper row of opacity 0.4, crossed twice",
        samples=256,
        edit=BLACK,
    ),
    Case(
        "42_tubes_opacity",
        (3, 1),
        {(0, 0): 1 - 0.8 * TWICE, (1, 0): 1 - 0.64 * TWICE, (2, 0): 1 - 0.8 * 0.4},
        "made black: a tube and a cube are crossed twice, a ribbon once",
        samples=256,
        edit=BLACK,
    ),
    Case(
        "solids",
        (8, 3),
        crossed(SOLIDS, 0, 1) | crossed(SOLIDS, 1) | crossed(LAST, 2) | {(7, 2): 1 - BALL + 3 * BALL},
        "areas from the side; in the middle row of opacity 0.4, crossed twice; above: instances, a tube whose joints "
        "do not count, a point, presence of 0.4, one below its threshold, and one that emits 3",
        samples=256,
    ),
    Case(
        "solids",
        (8, 3),
        crossed([pi * 0.2 * 0.1, 0.4 * 0.3, *SOLIDS[2:]], 0, 1) | {(6, 0): 1 - pi * 0.3**2},
        "a sphere and a cylinder of other sizes, and one that has a size now",
        samples=256,
        edit="""
view.finish(60.0)
for name, size in (("S0_0", {"radius": 0.2}), ("S1_0", {"height": 0.3}), ("S6_0", {"radius": 0.3})):
    for attribute, value in size.items():
        stage.GetPrimAtPath("/World/" + name).GetAttribute(attribute).Set(value)
""",
        variant="edited",
    ),
    Case(
        "solid_materials",
        (3, 1),
        {(0, 0): 1, (1, 0): 1, (2, 0): 1 - BALL},
        "clear glass under an even sky is not seen: what goes in comes out; a black sphere of 0.3 is displaced by 0.1",
        bounces=12,
    ),
    Case(
        "lines",
        (5, 1),
        {(0, 0): 1 - EIGHT, (1, 0): 1 - DOTS, (2, 0): 1 - EIGHT, (3, 0): 1 - BOX},
        "eight lines of 0.6, 49 dots, lines of a prototype of twice the size, the edges of a box, all a pixel wide",
        pixels=15,
        samples=256,
    ),
    Case(
        "41_draw_mode_bounds",
        (1, 1),
        {(0, 0): 1 - (4 * 0.1 * LINE - (4 - pi) / 4 * LINE**2)},
        "the edges of a box of 0.1",
        pixels=15,
        samples=256,
        edit='stage.GetPrimAtPath("/World").SetKind("group")' + MODEL,
    ),
    Case(
        "03_display_color_forms",
        (5, 3),
        FORMS,
        "quads of 0.81 of a cell, of the colour and the opacity that are authored in whatever form, or grey",
        unlike=UNREAD,
    ),
]
