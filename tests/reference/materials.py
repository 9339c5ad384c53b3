# SPDX-License-Identifier: Apache-2.0
"""UsdPreviewSurface as Mitsuba's own BSDFs. The variant must be set before this is imported.

The mapping, and why:
- metallic 1: a perfect mirror's Fresnel and `diffuseColor` as reflectance. UsdPreviewSurface's F0 and F90 are both the
  albedo there. With EXACT_METALS constant ones are compensated.py, exact; else `roughconductor`, which loses light
  between microfacets (2 % at roughness 0.3, grazing). GGX, alpha = roughness squared.
- opacity 0: `dielectric` with the same ior; exact. `roughdielectric` if rough, which loses light between microfacets:
  0.3 % of an interface at roughness 0.3 seen at 60 degrees, more where it is rougher. Transmission is tinted by
  diffuseColor.
- metallic 0: `roughplastic`, a Lambert base below a rough dielectric boundary: the same two lobes; real Fresnel instead
  of Schlick's, and the base is dimmed by the boundary as in nature. Models of the base differ by a few per cent.
- in between: `blendbsdf` of these by metallic, or by opacity. clearcoat: `principled`, of our alpha (its coat is a
  quarter as strong and of another shape).
- opacityThreshold: `mask` with the picture cut at four times its resolution. Roughness below 0.03 is smooth, as no
  microfacet model is stable there.
- emissiveColor: an `area` emitter, one-sided as all of Mitsuba's are.
"""

from __future__ import annotations

import pathlib
import tempfile
import zipfile

import mitsuba as mi
import numpy as np

import compensated  # noqa: F401  (registers its BSDF)
import networks

SMOOTH = 0.03
EXACT_METALS = False
"""Set by those who compare pictures, not times: Mitsuba runs its own BSDFs faster."""
PRINCIPLED_PLASTICS = False
"""Dielectrics that are not clear as `principled`: nearer to UsdPreviewSurface where rough than `roughplastic`, which
loses light."""


def decode(path: str) -> tuple[np.ndarray, int]:
    """(pixels as floats, encoded 0 .. 1 for integer files; bits of a channel)."""
    package, _, inside = path.partition("[")
    if inside:
        with (
            zipfile.ZipFile(package) as opened,
            tempfile.NamedTemporaryFile(suffix=pathlib.Path(inside[:-1]).suffix) as file,
        ):
            file.write(opened.read(inside[:-1]))
            file.flush()
            return decode(file.name)
    pixels = np.array(mi.Bitmap(path))
    pixels = pixels[..., None] if pixels.ndim == 2 else pixels
    if pixels.dtype.kind == "u":
        return pixels.astype(np.float64) / np.iinfo(pixels.dtype).max, 8 * pixels.dtype.itemsize
    return pixels.astype(np.float64), 8 * pixels.dtype.itemsize


def texture(value, notes: list[str]) -> dict:
    """A Mitsuba texture of a constant or a Picture; every number is linear already."""
    if not isinstance(value, networks.Picture):
        return (
            {"type": "rgb", "value": [float(x) for x in value]}
            if isinstance(value, tuple)
            else {"type": "uniform", "value": float(value)}
        )
    modes = {"repeat": "repeat", "mirror": "mirror", "clamp": "clamp"}
    if value.wrap[0] != value.wrap[1] or value.wrap[0] not in modes:
        notes.append(f"wrap modes {value.wrap} are taken as {modes.get(value.wrap[0], 'clamp')}")
    return {
        "type": "bitmap", "bitmap": mi.Bitmap(value.pixels if value.pixels.shape[2] > 1 else value.pixels[..., 0]),
        "raw": True,
        "wrap_mode": modes.get(value.wrap[0], "clamp"), "filter_type": "bilinear",
        "to_uv": mi.ScalarTransform3f(value.transform),
    }  # fmt: skip


def _alpha(roughness, notes):
    if isinstance(roughness, networks.Picture):
        return texture(
            networks.Picture(np.square(np.maximum(roughness.pixels, SMOOTH)), roughness.wrap, roughness.transform),
            notes,
        )
    return float(roughness) ** 2


def _is_smooth(roughness) -> bool:
    return not isinstance(roughness, networks.Picture) and roughness < SMOOTH


def _metal(values, notes) -> dict:
    made = {"material": "none", "specular_reflectance": texture(values["diffuseColor"], notes)}
    if _is_smooth(values["roughness"]):
        return {"type": "conductor", **made}
    if (
        EXACT_METALS
        and not isinstance(values["roughness"], networks.Picture)
        and isinstance(values["diffuseColor"], tuple)
    ):
        color = dict(zip("rgb", map(float, values["diffuseColor"])))
        return {"type": "compensated", "alpha": float(values["roughness"]) ** 2, **color}
    return {"type": "roughconductor", "distribution": "ggx", "alpha": _alpha(values["roughness"], notes), **made}


def _plastic(values, notes) -> dict:
    ior = float(values["ior"])
    if PRINCIPLED_PLASTICS and ior >= 1.05:
        return _coated({**values, "metallic": 0.0}, notes)
    if values["useSpecularWorkflow"]:
        f0 = float(np.mean(values["specularColor"])) if isinstance(values["specularColor"], tuple) else 0.04
        ior = (1 + f0**0.5) / max(1 - f0**0.5, 1e-3)
    if ior < 1.001:
        return {"type": "diffuse", "reflectance": texture(values["diffuseColor"], notes)}
    made = {"diffuse_reflectance": texture(values["diffuseColor"], notes), "int_ior": ior, "nonlinear": False}
    if _is_smooth(values["roughness"]):
        return {"type": "plastic", **made}
    if isinstance(values["roughness"], networks.Picture):
        notes.append("a textured roughness of a dielectric is taken as its mean")
        return {
            "type": "roughplastic", "distribution": "ggx", "alpha": float(np.mean(values["roughness"].pixels)) ** 2,
            **made,
        }
    return {"type": "roughplastic", "distribution": "ggx", "alpha": float(values["roughness"]) ** 2, **made}


def _coated(values, notes) -> dict:
    # Its alpha is 0.1 at gloss 0 and 0.001 at 1; ours is the square of clearcoatRoughness.
    gloss = min(1.0, max(0.0, (0.1 - float(values["clearcoatRoughness"]) ** 2) / 0.099))
    return {
        "type": "principled", "base_color": texture(values["diffuseColor"], notes),
        "metallic": texture(values["metallic"], notes), "roughness": texture(values["roughness"], notes),
        "eta": float(values["ior"]), "clearcoat": texture(values["clearcoat"], notes), "clearcoat_gloss": gloss,
    }  # fmt: skip


def _blend(a, b, weight, notes) -> dict:
    """`a` where the weight is 0."""
    if not isinstance(weight, networks.Picture):
        if weight <= 0:
            return a
        if weight >= 1:
            return b
    return {"type": "blendbsdf", "weight": texture(weight, notes), "first": a, "second": b}


def _doubled(grey: np.ndarray) -> np.ndarray:
    """Bilinear, twice the resolution, edges repeated."""
    for axis in (0, 1):
        before = np.concatenate([grey.take([0], axis), grey.take(range(grey.shape[axis] - 1), axis)], axis)
        after = np.concatenate([grey.take(range(1, grey.shape[axis]), axis), grey.take([-1], axis)], axis)
        both = np.stack([0.75 * grey + 0.25 * before, 0.75 * grey + 0.25 * after], axis + 1)
        grey = both.reshape(2 * grey.shape[0], -1) if axis == 0 else both.reshape(grey.shape[0], -1)
    return grey.astype(np.float32)


def _cut(picture: networks.Picture, threshold: float, notes) -> dict:
    grey = picture.pixels[..., 0]
    big = _doubled(_doubled(grey))
    made = texture(
        networks.Picture((big >= threshold).astype(np.float32)[..., None], picture.wrap, picture.transform), notes
    )
    made["filter_type"] = "nearest"
    return made


def bsdf(values: dict, notes: list[str]) -> dict:
    """The BSDF of UsdPreviewSurface's inputs as `networks.inputs` reads them."""
    opacity, threshold = values["opacity"], float(values["opacityThreshold"])
    coat = isinstance(values["clearcoat"], networks.Picture) or values["clearcoat"] > 0
    solid = (
        _coated(values, notes)
        if coat
        else _blend(_plastic(values, notes), _metal(values, notes), values["metallic"], notes)
    )
    if isinstance(values["normal"], networks.Picture):
        normal = values["normal"]
        encoded = networks.Picture((normal.pixels * 0.5 + 0.5).astype(np.float32), normal.wrap, normal.transform)
        solid = {"type": "normalmap", "normalmap": texture(encoded, notes), "bsdf": solid}
    solid = {"type": "twosided", "bsdf": solid}
    if threshold > 0:
        if isinstance(opacity, networks.Picture):
            return {"type": "mask", "opacity": _cut(opacity, threshold, notes), "bsdf": solid}
        return solid if opacity >= threshold else {"type": "null"}
    if isinstance(opacity, networks.Picture) or opacity >= 1:
        if isinstance(opacity, networks.Picture):
            notes.append("a textured opacity without threshold is taken as a mask")
            return {"type": "mask", "opacity": texture(opacity, notes), "bsdf": solid}
        return solid
    clear = {
        "type": "dielectric", "int_ior": float(values["ior"]), "ext_ior": 1.0,
        "specular_transmittance": texture(values["diffuseColor"], notes),
    }
    if not _is_smooth(values["roughness"]):
        clear |= {"type": "roughdielectric", "distribution": "ggx", "alpha": _alpha(values["roughness"], notes)}
    return _blend(clear, solid["bsdf"], opacity, notes)


def unbound(color, opacity: float) -> dict:
    """What meshes without a material are: Lambert of displayColor (None: 0.18), holes by displayOpacity."""
    reflectance = (
        {"type": "mesh_attribute", "name": "vertex_color"}
        if isinstance(color, str)
        else {"type": "rgb", "value": [float(x) for x in (color if color is not None else (0.18,) * 3)]}
    )
    made = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": reflectance}}
    return made if opacity >= 1 else {"type": "mask", "opacity": opacity, "bsdf": made}
