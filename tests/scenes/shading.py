# SPDX-License-Identifier: Apache-2.0
"""Materials in few calls: UsdPreviewSurface networks, texture readers, bindings, texture coordinates. Needs any pxr."""

from __future__ import annotations

from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

SURFACE_TYPES = {
    "useSpecularWorkflow": Sdf.ValueTypeNames.Int,
    "diffuseColor": Sdf.ValueTypeNames.Color3f,
    "emissiveColor": Sdf.ValueTypeNames.Color3f,
    "specularColor": Sdf.ValueTypeNames.Color3f,
    "normal": Sdf.ValueTypeNames.Normal3f,
}
"""Types of UsdPreviewSurface's inputs; the others are floats."""

OUTPUT_TYPES = {
    "rgb": Sdf.ValueTypeNames.Float3, "r": Sdf.ValueTypeNames.Float, "g": Sdf.ValueTypeNames.Float,
    "b": Sdf.ValueTypeNames.Float, "a": Sdf.ValueTypeNames.Float,
}


def _shader(stage, path, kind) -> UsdShade.Shader:
    shader = UsdShade.Shader.Define(stage, path)
    shader.CreateIdAttr(kind)
    return shader


def material(stage, path, **inputs) -> UsdShade.Material:
    """A material of one UsdPreviewSurface. An input is a number, a colour, or what `sample` or `primvar` returned: it
    is connected."""
    made = UsdShade.Material.Define(stage, path)
    surface = _shader(stage, f"{path}/Surface", "UsdPreviewSurface")
    for name, value in inputs.items():
        connect(surface.CreateInput(name, SURFACE_TYPES.get(name, Sdf.ValueTypeNames.Float)), value)
    made.CreateSurfaceOutput().ConnectToSource(surface.CreateOutput("surface", Sdf.ValueTypeNames.Token))
    return made


def connect(port, value) -> None:
    """Sets an input, or connects it to an output."""
    if isinstance(value, UsdShade.Output):
        port.ConnectToSource(value)
    elif isinstance(value, (tuple, list)):
        port.Set(Gf.Vec3f(*value))
    else:
        port.Set(value)


def primvar(stage, path, name, kind="float2", fallback=None) -> UsdShade.Output:
    """A UsdPrimvarReader of `name`; kind is the ending of its id."""
    types = {
        "float": Sdf.ValueTypeNames.Float, "float2": Sdf.ValueTypeNames.Float2, "float3": Sdf.ValueTypeNames.Float3,
        "float4": Sdf.ValueTypeNames.Float4,
    }
    reader = _shader(stage, path, f"UsdPrimvarReader_{kind}")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set(name)
    if fallback is not None:
        connect(reader.CreateInput("fallback", types[kind]), fallback)
    return reader.CreateOutput("result", types[kind])


def transform2d(stage, path, source, scale=(1, 1), rotation=0.0, translation=(0, 0)) -> UsdShade.Output:
    """UsdTransform2d: scale, then rotate (degrees, counterclockwise), then translate."""
    node = _shader(stage, path, "UsdTransform2d")
    node.CreateInput("in", Sdf.ValueTypeNames.Float2).ConnectToSource(source)
    node.CreateInput("scale", Sdf.ValueTypeNames.Float2).Set(Gf.Vec2f(*scale))
    node.CreateInput("rotation", Sdf.ValueTypeNames.Float).Set(rotation)
    node.CreateInput("translation", Sdf.ValueTypeNames.Float2).Set(Gf.Vec2f(*translation))
    return node.CreateOutput("result", Sdf.ValueTypeNames.Float2)


def sample(
    stage, path, file, output="rgb", st=None, wrap="repeat", color_space=None, scale=None, bias=None, fallback=None
) -> UsdShade.Output:
    """A UsdUVTexture and the reader of `st` below `path`; `st` replaces that reader. `wrap`: one mode, a pair, or None
    to author none.

    Asked again for the same path, only another output is made.
    """
    reader = UsdShade.Shader.Get(stage, path)
    if reader:
        return reader.CreateOutput(output, OUTPUT_TYPES[output])
    reader = _shader(stage, path, "UsdUVTexture")
    reader.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(Sdf.AssetPath(str(file)))
    coordinates = st if st is not None else primvar(stage, f"{path}_st", "st")
    reader.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(coordinates)
    if wrap is not None:
        for name, mode in zip(("wrapS", "wrapT"), (wrap, wrap) if isinstance(wrap, str) else wrap):
            reader.CreateInput(name, Sdf.ValueTypeNames.Token).Set(mode)
    if color_space is not None:
        reader.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set(color_space)
    for name, value in (("scale", scale), ("bias", bias), ("fallback", fallback)):
        if value is not None:
            reader.CreateInput(name, Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(*value))
    return reader.CreateOutput(output, OUTPUT_TYPES[output])


def normal_map(stage, path, file, **options) -> UsdShade.Output:
    """As `sample`, with the scale and bias that turn 0 .. 1 into -1 .. 1."""
    return sample(stage, path, file, color_space="raw", scale=(2, 2, 2, 1), bias=(-1, -1, -1, 0), **options)


def bind(prim, what, **options) -> None:
    """Binds a material; prim is any schema object or Usd.Prim."""
    prim = prim if isinstance(prim, Usd.Prim) else prim.GetPrim()
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(what, **options)


def coordinates(prim, values, interpolation="vertex", name="st") -> None:
    """Texture coordinates as a primvar."""
    made = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(name, Sdf.ValueTypeNames.TexCoord2fArray, interpolation)
    made.Set(Vt.Vec2fArray([Gf.Vec2f(*value) for value in values]))


def subset(prim, name, faces, what) -> UsdGeom.Subset:
    """A GeomSubset of the family materialBind with a material of its own."""
    made = UsdGeom.Subset.CreateGeomSubset(
        prim, name, UsdGeom.Tokens.face, Vt.IntArray(list(faces)), UsdShade.Tokens.materialBind,
        UsdGeom.Tokens.nonOverlapping,
    )
    bind(made, what)
    return made
