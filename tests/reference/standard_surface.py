# SPDX-License-Identifier: Apache-2.0
"""MaterialX's standard_surface, as UsdMtlx writes it into a stage, as Mitsuba's `principled`. The variant must be set
before this is imported.

Read are constants, `image` nodes (periodic, bilinear, on `st`) and `normalmap` on an image. How the models differ:
- Both are GGX of alpha = roughness squared over a diffuse base. Disney's base is brighter at grazing angles where rough
  and darker where smooth; standard_surface's is Lambert's, dimmed by what the dielectric reflects.
- Metals: both take base_color for F0 and white at 90 degrees. `principled` loses light between microfacets.
- Transmission: `principled` tints a refraction by the root of base_color, standard_surface by transmission_color.
- Subsurface is the diffuse base here (the product's approximation too).
"""

from __future__ import annotations

import functools

import mitsuba as mi
import numpy as np
from pxr import UsdShade

import materials

KIND = "ND_standard_surface_surfaceshader"
DEFAULTS = {
    "base": 1.0, "base_color": (0.8, 0.8, 0.8), "metalness": 0.0, "specular": 1.0, "specular_roughness": 0.2,
    "specular_IOR": 1.5, "transmission": 0.0, "transmission_color": (1.0, 1.0, 1.0), "normal": None,
}  # fmt: skip
"""MaterialX 1.39."""
LEFT_OUT = {
    "coat": 0.0, "sheen": 0.0, "emission": 0.0, "thin_film_thickness": 0.0, "specular_anisotropy": 0.0,
    "transmission_depth": 0.0, "transmission_scatter": (0.0, 0.0, 0.0), "opacity": (1.0, 1.0, 1.0), "base": 1.0,
    "specular": 1.0, "diffuse_roughness": 0.0, "thin_walled": False,
}  # fmt: skip


def surface(material: UsdShade.Material) -> UsdShade.Shader | None:
    """The standard_surface of a material, or None."""
    shader, _, _ = material.ComputeSurfaceSource("mtlx")
    return shader if shader and shader.GetIdAttr().Get() == KIND else None


def _found(shader: UsdShade.Shader, name: str, default, notes: list[str]):
    """A constant or a texture."""
    port = shader.GetInput(name)
    for attribute in port.GetValueProducingAttributes() if port else ():
        if not UsdShade.Output.IsOutput(attribute):
            value = attribute.Get()
            return default if value is None else tuple(value) if hasattr(value, "__len__") else value
        node = UsdShade.Shader(attribute.GetPrim())
        kind = str(node.GetIdAttr().Get())
        if kind.startswith("ND_normalmap"):
            return _found(node, "in", default, notes)
        if kind in ("ND_image_color3", "ND_image_float", "ND_image_vector3"):
            return _picture(node)
        notes.append(f"{node.GetPath()}: {kind} is not translated, the default is taken")
    return default


def _picture(node: UsdShade.Shader):
    file = node.GetInput("file").GetAttr()
    return _shared(file.Get().resolvedPath, file.GetColorSpace() == "srgb_texture")


# Textures are shared, and read by Mitsuba itself (half floats): what a scene written for it would do.
@functools.cache
def _shared(path: str, decoded: bool):
    # Mitsuba's row 0, at v = 0, is the picture's upper one.
    turned = mi.ScalarTransform3f(np.diag([1.0, -1.0, 1.0]))
    return mi.load_dict({"type": "bitmap", "filename": path, "raw": not decoded, "to_uv": turned})


def _texture(value, notes: list[str]):
    return value if isinstance(value, mi.Texture) else materials.texture(value, notes)


def bsdf(material: UsdShade.Material, notes: list[str]) -> dict:
    """The `principled` of a material whose `surface` is there."""
    shader = surface(material)
    values = {name: _found(shader, name, default, notes) for name, default in DEFAULTS.items()}
    for name, default in LEFT_OUT.items():
        if _found(shader, name, default, notes) != default:
            notes.append(f"{material.GetPath()}: {name} is left out")
    made = {
        "type": "principled", "roughness": _texture(values["specular_roughness"], notes),
        "eta": float(values["specular_IOR"]),
    }  # fmt: skip
    clear = values["transmission"]
    if isinstance(clear, mi.Texture) or clear not in (0.0, 1.0):
        notes.append(f"{material.GetPath()}: transmission between 0 and 1 is taken as 0")
        clear = 0.0
    if clear:
        tint = tuple(float(x) ** 2 for x in values["transmission_color"])
        made |= {"base_color": _texture(tint, notes), "spec_trans": 1.0}
    else:
        made |= {
            "base_color": _texture(values["base_color"], notes),
            "metallic": _texture(values["metalness"], notes),
        }
    if isinstance(values["normal"], mi.Texture):
        made = {"type": "normalmap", "normalmap": _texture(values["normal"], notes), "bsdf": made}
    return made if clear else {"type": "twosided", "bsdf": made}
