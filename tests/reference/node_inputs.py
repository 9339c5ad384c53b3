# SPDX-License-Identifier: Apache-2.0
"""Random inputs of MaterialX's pattern nodes: `nodes.py` asks for them.

Numbers have at most three decimals, so that they are short in text and the same f32 wherever they are read. They leave
the usual range: negative ones, zeros, ones, large ones, and now and then inputs of one type that are equal.
"""

from collections.abc import Callable

import numpy as np

Numbers = np.ndarray
Draw = Callable[[np.random.Generator, tuple[int, int]], Numbers]

WIDTHS = {
    "float": 1,
    "integer": 1,
    "boolean": 1,
    "vector2": 2,
    "vector3": 3,
    "vector4": 4,
    "color3": 3,
    "color4": 4,
    "matrix33": 9,
    "matrix44": 16,
}


def within(low: float, high: float) -> Draw:
    """Uniform."""
    return lambda rng, shape: rng.uniform(low, high, shape)


def whole(low: int, high: int) -> Draw:
    """Whole numbers, both ends included."""
    return lambda rng, shape: rng.integers(low, high + 1, shape).astype(float)


def places(rng: np.random.Generator, shape: tuple[int, int]) -> Numbers:
    """Coordinates: some about the unit square, some far away, some on the lattice of noise."""
    kind = rng.integers(0, 10, (shape[0], 1))
    far = rng.uniform(-30, 30, shape)
    return np.select([kind < 4, kind < 9], [rng.uniform(-0.5, 1.5, shape), far], np.floor(far))


def anything(rng: np.random.Generator, shape: tuple[int, int]) -> Numbers:
    """Numbers of any kind."""
    kind = rng.integers(0, 20, shape)
    special = rng.choice([0.0, 1.0, -1.0, 0.5, 2.0], shape)
    usual, wide, large = rng.uniform(0, 1, shape), rng.uniform(-3, 3, shape), rng.uniform(-100, 100, shape)
    return np.select([kind < 9, kind < 15, kind < 18], [usual, wide, special], large)


def usual(rng: np.random.Generator, shape: tuple[int, int]) -> Numbers:
    """Shares, now and then beyond 0 to 1."""
    return np.where(rng.random(shape) < 0.8, rng.uniform(0, 1, shape), rng.uniform(-0.3, 1.3, shape))


DEGREES = within(-400, 400)

# By category (or "") and input; the first that is there counts.
KNOWN: dict[tuple[str, str], Draw] = {
    ("", "octaves"): whole(0, 6),
    ("", "lacunarity"): within(0.5, 3),
    ("", "diminish"): within(-1, 1),
    ("", "jitter"): within(-0.5, 1.5),
    ("", "style"): whole(0, 1),
    ("", "texcoord"): places,
    ("", "position"): places,
    ("", "which"): within(-1, 11),
    ("", "rotate"): DEGREES,
    ("", "angle"): DEGREES,
    ("", "rotation"): DEGREES,
    ("rotate2d", "amount"): DEGREES,
    ("rotate3d", "amount"): DEGREES,
    ("", "temperature"): within(500, 30000),
    ("unifiednoise2d", "type"): whole(0, 3),
    ("unifiednoise3d", "type"): whole(0, 3),
    ("", "num_intervals"): whole(1, 10),
    ("ramp", "type"): whole(0, 3),
    ("ramp", "interpolation"): whole(0, 2),
    ("ramp_gradient", "interpolation"): whole(0, 2),
    ("randomfloat", "seed"): whole(0, 1000),
    ("randomcolor", "seed"): whole(0, 1000),
    ("texcoord", "index"): whole(0, 0),
    ("geomcolor", "index"): whole(0, 0),
    ("exp", "in"): within(-10, 10),
    ("asin", "in"): within(-1, 1),
    ("acos", "in"): within(-1, 1),
    ("deon_hair_absorption_from_melanin", "eumelanin_color"): within(0.01, 1.2),
    ("deon_hair_absorption_from_melanin", "pheomelanin_color"): within(0.01, 1.2),
    ("refract", "ior"): within(0.4, 2.5),
    ("trianglewave", "in"): within(-5, 5),
    ("", "mix"): usual,
    ("", "operationorder"): whole(0, 1),
    ("ramp_gradient", "interval_num"): whole(1, 9),
    ("", "gamma"): within(0.2, 3),
    ("gooch_shade", "shininess"): within(0, 64),
}
# Categories whose numbers are shares.
SHARES = {
    "g18_rec709_to_lin_rec709",
    "g22_rec709_to_lin_rec709",
    "rec709_display_to_lin_rec709",
    "acescg_to_lin_rec709",
    "g22_ap1_to_lin_rec709",
    "srgb_texture_to_lin_rec709",
    "lin_adobergb_to_lin_rec709",
    "adobergb_to_lin_rec709",
    "srgb_displayp3_to_lin_rec709",
    "lin_displayp3_to_lin_rec709",
    "colorcorrect",
    "open_pbr_anisotropy",
    "standard_surface_to_gltf_pbr",
    "standard_surface_to_UsdPreviewSurface",
    "standard_surface_to_open_pbr_surface",
    "open_pbr_surface_to_standard_surface",
    "roughness_anisotropy",
    "roughness_dual",
    "glossiness_anisotropy",
    "artistic_ior",
    "deon_hair_absorption_from_melanin",
    "chiang_hair_absorption_from_color",
    "chiang_hair_roughness",
    "gltf_iridescence_thickness",
    "gltf_normalmap",
    "randomcolor",
}


def draw(category: str, name: str, kind: str, rng: np.random.Generator, rows: int) -> Numbers:
    """`rows` values of an input."""
    shape = (rows, WIDTHS[kind])
    known = KNOWN.get((category, name)) or KNOWN.get(("", name))
    if kind == "boolean":
        known = whole(0, 1)
    elif category == "extract" and name == "index":
        known = whole(0, 1)
    elif kind == "integer" and known is None:
        known = whole(-3, 8)
    elif known is None:
        known = usual if category in SHARES else anything
    values = known(rng, shape)
    return np.floor(values) if kind in ("integer", "boolean") else np.round(values, 3) + 0.0


def table(category: str, inputs: list[tuple[str, str]], rng: np.random.Generator, rows: int) -> list[Numbers]:
    """Values of all inputs: those of one type are the same in one row of eight."""
    found = [draw(category, name, kind, rng, rows) for name, kind in inputs]
    same = rng.random(rows) < 0.125
    first: dict[str, Numbers] = {}
    for (name, kind), values in zip(inputs, found, strict=True):
        known = ((category, name) in KNOWN) or (("", name) in KNOWN)
        if not known and kind != "boolean":
            values[same] = first.setdefault(kind, values)[same]
    return found
