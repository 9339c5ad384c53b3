# SPDX-License-Identifier: Apache-2.0
"""Light and shadow links of instances: native and point instances, at two levels.

A distant light of irradiance pi along the normal, and a dome of radiance 1 above a plane, make albedo 0.5 shine with
0.5. What is in the collection of a light has that, what is not has none. Direct light only, middles of cells.
"""

from cases.case import Case

BOTH, GREEN, NONE = (0.5, 0.5, 0), (0, 0.5, 0), (0, 0, 0)


def _row(file, values, why, **more):
    cells = {(x, 0): value for x, value in enumerate(values)}
    return Case(file, (4, 1), cells, why, **{"bounces": 0, "inset": 0.25, "samples": 256, "silent": True, **more})


def _grid(file, values, why, **more):
    cells = {(index % 4, index // 4): value for index, value in enumerate(values)}
    return Case(file, (4, 2), cells, why, **{"bounces": 0, "inset": 0.25, "samples": 256, "silent": True, **more})


_UNDER = "the caster at z = 1 covers the middle of its cell's floor, unless the collection of shadows lacks it"

CASES = [
    _row("25_links_both_native_included", (BOTH, BOTH, GREEN, GREEN), "red is linked to both instances alone"),
    _row("25_links_instancer_included", (BOTH, BOTH, GREEN, GREEN), "red is linked to the instancer alone"),
    _row("25_links_native_instances_unrelated_exclude", (BOTH, BOTH, GREEN, BOTH), "red excludes the third cell"),
    _row("25_links_point_instances_unrelated_exclude", (BOTH, BOTH, GREEN, BOTH), "red excludes the third cell"),
    _row("25_links_native_one_excluded", (GREEN, BOTH, BOTH, BOTH), "red excludes the first of two instances"),
    _row("25_links_shadow_native", (NONE, NONE, (0.5, 0, 0), NONE), _UNDER),
    _row("25_links_shadow_point", (NONE, NONE, (0.5, 0, 0), NONE), _UNDER),
    _row(
        "25_links_native_one_excluded",
        (BOTH, GREEN, BOTH, GREEN),
        "red excludes the second instance and the fourth cell, after a picture in which it excluded the first instance",
        variant="edited",
        later="stage.GetPrimAtPath('/Red').GetRelationship('collection:lightLink:excludes')"
        ".SetTargets(['/World/B', '/World/t3'])",
    ),
    _row(
        "25_links_point_instances_unrelated_exclude",
        (GREEN, GREEN, BOTH, BOTH),
        "red excludes the instancer, after a picture in which it excluded the third cell",
        variant="edited",
        later="stage.GetPrimAtPath('/Red').GetRelationship('collection:lightLink:excludes').SetTargets(['/World/P'])",
    ),
    _row(
        "25_links_shadow_native",
        ((0.5, 0, 0), NONE, NONE, NONE),
        "red has no shadow of the first instance, after a picture in which it had none of the third cell's caster",
        variant="edited",
        later="stage.GetPrimAtPath('/Red').GetRelationship('collection:shadowLink:excludes').SetTargets(['/World/A'])",
    ),
    _grid(
        "25_links_nested",
        (
            (0, 0.5, 0),
            (0.5, 0, 0.5),
            (0, 0, 0.5),
            (0.5, 0, 0.5),
            (0.5, 0.5, 0),
            (0, 0, 0.5),
            (0.5, 0, 0),
            (0, 0, 0.5),
        ),
        "red, of all but A P C E; green, a dome, of A I; blue of B P N C E. A, B: a native instance in a native one;"
        " P: a prototype that lies elsewhere; N: a point instancer in one; I: a native instance in one; C, D: a point"
        " instancer in a native instance; E: a ribbon",
    ),
    _grid(
        "25_links_nested_shadows",
        (
            (0.5, 0, 0.5),
            (0, 0, 0),
            (0.5, 0, 0),
            (0, 0, 0),
            (0, 0, 0.5),
            (0.5, 0, 0),
            (0, 0, 0.5),
            (0.5, 0, 0.5),
        ),
        "casters as in 25_links_nested, none in the last cell; shadows of red by all but A P C, of blue by B P N C",
    ),
]
