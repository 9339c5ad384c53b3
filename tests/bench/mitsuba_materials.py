# SPDX-License-Identifier: Apache-2.0
"""Materials of a USD stage as Mitsuba's dictionaries, and pictures as plain data (see mitsuba_scene.py). Needs pxr and
numpy.

- UsdPreviewSurface: `principled`, the same GGX of alpha = roughness squared over a diffuse base, F0 by `ior`. Opacity
  below 1 without a threshold: `blendbsdf` with a `dielectric` of the same ior. Opacity with a threshold: `mask` with
  the picture cut there. `normal`: `normalmap`. Rough dielectrics are `diffuse`: the base of `principled` is brighter
  than Lambert's there (a room of walls of roughness 0.9 by 6 %), its other lobe is faint.
- MaterialX's standard_surface: `principled` with its clearcoat for `coat`; clear: `dielectric` tinted by
  `transmission_color`. Of nodes, constants, images and the background of a mix are read.
- emissiveColor and emission: an `area` emitter.
"""

from __future__ import annotations

import math

import numpy as np
from pxr import Sdf, Usd, UsdShade

SMOOTH = 0.03
"""Roughness below which a clear surface is smooth."""
ROUGH = 0.8
"""Roughness from which a dielectric without a coat is `diffuse`."""
MIN_IOR = 1.05
"""Of `principled`."""
PREVIEW = {
    "diffuseColor": (0.18, 0.18, 0.18), "emissiveColor": (0.0, 0.0, 0.0), "useSpecularWorkflow": 0, "metallic": 0.0,
    "roughness": 0.5, "clearcoat": 0.0, "clearcoatRoughness": 0.01, "opacity": 1.0, "opacityThreshold": 0.0,
    "ior": 1.5, "normal": (0.0, 0.0, 1.0),
}  # fmt: skip
STANDARD = {
    "base": 1.0, "base_color": (0.8, 0.8, 0.8), "metalness": 0.0, "specular": 1.0, "specular_roughness": 0.2,
    "specular_IOR": 1.5, "specular_anisotropy": 0.0, "transmission": 0.0, "transmission_color": (1.0, 1.0, 1.0),
    "coat": 0.0, "coat_roughness": 0.1, "emission": 0.0, "emission_color": (1.0, 1.0, 1.0), "sheen": 0.0,
    "subsurface": 0.0, "thin_film_thickness": 0.0, "opacity": (1.0, 1.0, 1.0), "thin_walled": False,
}  # fmt: skip
LEFT_OUT = ("sheen", "subsurface", "thin_film_thickness", "opacity", "thin_walled", "specular")
"""Of standard_surface, where it is not the default."""
CHANNELS = {"r": "r", "g": "g", "b": "b", "a": "a", "rgb": "rgb"}


class Notes:
    """What is left out: by reason, how often and where first."""

    def __init__(self) -> None:
        self._found: dict[str, list] = {}

    def add(self, reason: str, prim) -> None:
        entry = self._found.setdefault(reason, [0, "" if prim is None else str(prim.GetPath())])
        entry[0] += 1

    def told(self) -> list[str]:
        return [reason + (f": {count}, first {path}" if path else "") for reason, (count, path) in self._found.items()]


def rgb(value) -> dict:
    return {"type": "rgb", "value": [float(x) for x in value]}


def picture(files, space: str, channels: str, wrap: str, transform, scale=(1, 1, 1), bias=(0, 0, 0)) -> dict:
    """A bitmap: `files` are [path, column, row] of tiles; `transform` maps st to their whole, row 0 at t = 0."""
    own = {"files": files, "space": space, "channels": channels}
    own |= {"scale": [float(x) for x in scale], "bias": [float(x) for x in bias]}
    transform = np.asarray(transform, float).tolist()
    return {
        "type": "bitmap", "raw": True, "wrap_mode": wrap, "filter_type": "bilinear", "to_uv": {"matrix": transform},
        "picture": own,
    }  # fmt: skip


def is_picture(value) -> bool:
    return isinstance(value, dict)


def texture(value) -> dict:
    """A Mitsuba texture of a number, a colour or a picture."""
    if is_picture(value):
        return value
    return rgb(value) if hasattr(value, "__len__") else {"type": "uniform", "value": float(value)}


def _value(shader, name, default, time):
    port = shader.GetInput(name)
    value = port.Get(time) if port else None
    return default if value is None else value


def found(shader: UsdShade.Shader, name: str, default, time, notes: Notes):
    """An input: a constant or a picture."""
    port = shader.GetInput(name)
    for attribute in port.GetValueProducingAttributes() if port else ():
        if not UsdShade.Output.IsOutput(attribute):
            value = attribute.Get(time)
            return default if value is None else tuple(value) if hasattr(value, "__len__") else value
        return _node(UsdShade.Shader(attribute.GetPrim()), attribute.GetName(), default, time, notes)
    return default


def _node(node: UsdShade.Shader, output: str, default, time, notes: Notes):
    kind = str(node.GetIdAttr().Get())
    if kind == "UsdUVTexture":
        return uv_texture(node, output.rpartition(":")[2], time, notes)
    if kind.startswith("ND_image_"):
        file = node.GetInput("file").GetAttr()
        space = "sRGB" if file.GetColorSpace() == "srgb_texture" else "raw"
        channels = "rgb" if kind.endswith(("color3", "vector3")) else "r"
        return _files(node, file.Get(time), space, channels, "repeat", np.eye(3), notes, default)
    if kind.startswith("ND_normalmap"):
        return found(node, "in", default, time, notes)
    if kind.startswith("ND_mix_"):
        notes.add("a mix of a material, taken as its background", node)
        return found(node, "bg", default, time, notes)
    notes.add(f"{kind} of a material, the input's default is taken", node)
    return default


def coordinates(node: UsdShade.Shader, time, notes: Notes) -> np.ndarray:
    """The UsdTransform2d nodes in front of `st` as a matrix of 3 x 3."""
    made, name = np.eye(3), "st"
    for _ in range(64):
        port = node.GetInput(name)
        sources = port.GetConnectedSources()[0] if port else []
        if not sources:
            break
        node = UsdShade.Shader(sources[0].source.GetPrim())
        kind = node.GetIdAttr().Get()
        if kind != "UsdTransform2d":
            if kind == "UsdPrimvarReader_float2" and _value(node, "varname", "st", time) not in ("st", ""):
                notes.add("texture coordinates of another name than st, st is taken", node)
            break
        sx, sy = _value(node, "scale", (1, 1), time)
        angle, move = math.radians(_value(node, "rotation", 0.0, time)), _value(node, "translation", (0, 0), time)
        c, s = math.cos(angle), math.sin(angle)
        made = made @ np.array([[c * sx, -s * sy, move[0]], [s * sx, c * sy, move[1]], [0, 0, 1]])
        name = "in"
    return made


def uv_texture(node: UsdShade.Shader, output: str, time, notes: Notes):
    """A UsdUVTexture's output: a picture, or its fallback."""
    channels = CHANNELS[output]
    pick = ["rgba".index(channel) for channel in channels]
    values = lambda name, default: [_value(node, name, default, time)[at] for at in pick]
    wraps = [str(_value(node, name, "useMetadata", time)) for name in ("wrapS", "wrapT")]
    wrap = wraps[0] if wraps[0] in ("repeat", "mirror", "clamp") else "clamp"
    if wraps != [wrap] * 2:
        notes.add(f"wrap modes {' and '.join(wraps)}, taken as {wrap}", node)
    fallback = values("fallback", (0, 0, 0, 1))
    fallback = tuple(fallback) if len(pick) == 3 else fallback[0]
    asset, space = _value(node, "file", Sdf.AssetPath(""), time), str(_value(node, "sourceColorSpace", "auto", time))
    made = _files(node, asset, space, channels, wrap, coordinates(node, time, notes), notes, fallback)
    if is_picture(made):
        made["picture"] |= {"scale": values("scale", (1, 1, 1, 1)), "bias": values("bias", (0, 0, 0, 0))}
    return made


def _files(node, asset, space: str, channels: str, wrap: str, transform, notes: Notes, fallback):
    """The picture of an asset; UDIM tiles are put together."""
    files = [[asset.resolvedPath, 0, 0]] if asset and asset.resolvedPath and "<UDIM>" not in asset.path else []
    across = rows = 1
    if asset and "<UDIM>" in asset.path:
        for path, tile in tiles(node.GetInput("file").GetAttr(), asset):
            files.append([path, (tile - 1001) % 10, (tile - 1001) // 10])
        across = max((column for _, column, _ in files), default=0) + 1
        rows = max((row for _, _, row in files), default=0) + 1
    if not files:
        notes.add("a texture without a file, its fallback is taken", node)
        return fallback
    scale = np.diag([1 / across, 1 / rows, 1.0])
    count = len(channels)
    return picture(files, space, channels, wrap, scale @ transform, [1.0] * count, [0.0] * count)


def tiles(attribute: Usd.Attribute, asset: Sdf.AssetPath) -> list[tuple[str, int]]:
    """Files of a set of UDIM tiles and their numbers."""
    from pxr import UsdShade

    for spec in attribute.GetPropertyStack():
        made = UsdShade.UdimUtils.ResolveUdimTilePaths(asset.path, spec.layer)
        if made:
            return [(path, int(tile)) for path, tile in made]
    return []


def bsdf(material: UsdShade.Material, time, notes: Notes) -> tuple[dict, dict | None]:
    """The BSDF of a material and what it shines, or None."""
    shader = material.ComputeSurfaceSource("mtlx")[0]
    kind = str(shader.GetIdAttr().Get()) if shader else ""
    if kind == "ND_standard_surface_surfaceshader":
        return standard({name: found(shader, name, default, time, notes) for name, default in STANDARD.items()},
            material, notes)  # fmt: skip
    if kind in ("UsdPreviewSurface", "ND_UsdPreviewSurface_surfaceshader"):
        return preview({name: found(shader, name, default, time, notes) for name, default in PREVIEW.items()},
            material, notes)  # fmt: skip
    notes.add(f"a material of {kind or 'no surface'}, taken as grey", material)
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": rgb((0.18,) * 3)}}, None


def displacement(material: UsdShade.Material | None, time, notes: Notes) -> dict | None:
    """The picture that moves a surface along its normals, None if none does."""
    shader = material.ComputeDisplacementSource()[0] if material else None
    if not shader:
        return None
    if shader.GetIdAttr().Get() != "UsdPreviewSurface":
        notes.add("a displacement that is not of UsdPreviewSurface", material)
        return None
    value = found(shader, "displacement", 0.0, time, notes)
    if not is_picture(value) and value:
        notes.add("a displacement without a texture", material)
    return value if is_picture(value) else None


def _number(value, reason: str, material, notes: Notes, default: float) -> float:
    if is_picture(value):
        notes.add(f"a texture of {reason}, taken as {default:g}", material)
        return default
    return float(value)


def _glow(color, scale, material, notes: Notes) -> dict | None:
    if is_picture(color):
        return color
    value = np.array(color, float) * _number(scale, "emission", material, notes, 1.0)
    return rgb(value) if value.any() else None


def _gloss(roughness: float) -> float:
    """Of `principled`'s coat, whose alpha is 0.1 at gloss 0 and 0.001 at 1."""
    return min(1.0, max(0.0, (0.1 - roughness**2) / 0.099))


def principled(color, metallic, roughness, ior: float, coat, coat_roughness: float, anisotropy=0.0) -> dict:
    is_coated, numbers = is_picture(coat) or coat > 0, not is_picture(metallic) and not is_picture(roughness)
    if numbers and metallic == 0 and roughness >= ROUGH and not is_coated:
        return {"type": "diffuse", "reflectance": texture(color)}
    made = {
        "type": "principled", "base_color": texture(color), "metallic": texture(metallic),
        "roughness": texture(roughness), "eta": max(float(ior), MIN_IOR),
    }  # fmt: skip
    if is_coated:
        made |= {"clearcoat": texture(coat), "clearcoat_gloss": _gloss(coat_roughness)}
    if is_picture(anisotropy) or anisotropy:
        made["anisotropic"] = texture(anisotropy)
    return made


def clear(ior: float, roughness: float, tint) -> dict:
    made = {"int_ior": float(ior), "ext_ior": 1.0, "specular_transmittance": texture(tint)}
    if roughness < SMOOTH:
        return {"type": "dielectric", **made}
    return {"type": "roughdielectric", "distribution": "ggx", "alpha": roughness**2, **made}


def preview(values: dict, material, notes: Notes) -> tuple[dict, dict | None]:
    """UsdPreviewSurface's inputs as `found` reads them."""
    number = lambda name: _number(values[name], name, material, notes, PREVIEW[name])
    ior, opacity, threshold = number("ior"), values["opacity"], number("opacityThreshold")
    if values["useSpecularWorkflow"]:
        notes.add("the specular workflow, taken as the metallic one", material)
    solid = principled(
        values["diffuseColor"], values["metallic"], values["roughness"], ior, values["clearcoat"],
        number("clearcoatRoughness"),
    )  # fmt: skip
    solid = bent(solid, values["normal"], material, notes)
    glow = _glow(values["emissiveColor"], 1.0, material, notes)
    both = {"type": "twosided", "bsdf": solid}
    if is_picture(opacity):
        cut = {**opacity, "picture": dict(opacity["picture"])}
        if threshold > 0:
            cut["picture"]["threshold"] = threshold
            cut["filter_type"] = "nearest"
        else:
            notes.add("a texture of opacity without a threshold, taken as holes", material)
        return {"type": "mask", "opacity": cut, "bsdf": both}, glow
    if threshold > 0:
        return (both, glow) if opacity >= threshold else ({"type": "null"}, None)
    if opacity >= 1:
        return both, glow
    see = clear(ior, number("roughness"), values["diffuseColor"])
    if opacity <= 0:
        return see, glow
    return {"type": "blendbsdf", "weight": float(opacity), "first": see, "second": solid}, glow


def bent(solid: dict, normal, material, notes: Notes) -> dict:
    """With a normal map: Mitsuba's has values of 0 to 1."""
    if not is_picture(normal):
        return solid
    own = normal["picture"]
    encoded = {**normal, "picture": {
        **own, "scale": [x / 2 for x in own["scale"]], "bias": [x / 2 + 0.5 for x in own["bias"]]
    }}  # fmt: skip
    return {"type": "normalmap", "normalmap": encoded, "bsdf": solid}


def standard(values: dict, material, notes: Notes) -> tuple[dict, dict | None]:
    """standard_surface's inputs as `found` reads them."""
    number = lambda name: _number(values[name], name, material, notes, STANDARD[name])
    for name in LEFT_OUT:
        if values[name] != STANDARD[name]:
            notes.add(f"{name} of a standard_surface", material)
    glow = _glow(values["emission_color"], values["emission"], material, notes) if values["emission"] else None
    transmission, ior = number("transmission"), number("specular_IOR")
    color, base = values["base_color"], number("base")
    if is_picture(color):
        color = {**color, "picture": {**color["picture"], "scale": [x * base for x in color["picture"]["scale"]]}}
    else:
        color = tuple(base * x for x in color)
    solid = principled(
        color, values["metalness"], values["specular_roughness"], ior, values["coat"], number("coat_roughness"),
        values["specular_anisotropy"],
    )  # fmt: skip
    if transmission <= 0:
        return {"type": "twosided", "bsdf": solid}, glow
    see = clear(ior, number("specular_roughness"), values["transmission_color"])
    if transmission >= 1:
        return see, glow
    return {"type": "blendbsdf", "weight": 1 - transmission, "first": see, "second": solid}, glow
