# SPDX-License-Identifier: Apache-2.0
"""Materials of the exported stage: textures without a file, colours of meshes, and materials that were not exported.

Textures that have no file: Blender's exporter writes the paths that packed and generated images would have, and no
files there. They are written into Blender's own temporary folder, which it removes."""

import hashlib
import pathlib

import bpy

# Endings of files by the format of an image that has no file yet.
ENDINGS = {"JPEG": ".jpg", "OPEN_EXR": ".exr", "OPEN_EXR_MULTILAYER": ".exr", "HDR": ".hdr", "TIFF": ".tif",
           "TARGA": ".tga", "BMP": ".bmp"}  # fmt: skip


# Inputs of UsdPreviewSurface, and of Blender's principled material.
PLAIN_INPUTS = (("diffuseColor", "Base Color"), ("roughness", "Roughness"), ("metallic", "Metallic"))


def define_plain(prim, material):
    """Below a prim, the colour, roughness and metalness of a material that no mesh has: the exporter leaves it out."""
    from pxr import Sdf, UsdShade

    path = prim.GetPath().AppendChild("material")
    made = UsdShade.Material.Define(prim.GetStage(), path)
    shader = UsdShade.Shader.Define(prim.GetStage(), path.AppendChild("surface"))
    shader.CreateIdAttr("UsdPreviewSurface")
    nodes = material.node_tree.nodes if material.node_tree else ()
    principled = next((node for node in nodes if node.type == "BSDF_PRINCIPLED"), None)
    for name, blenders in PLAIN_INPUTS if principled else ():
        value = principled.inputs[blenders].default_value
        is_color = name == "diffuseColor"
        kind = Sdf.ValueTypeNames.Color3f if is_color else Sdf.ValueTypeNames.Float
        shader.CreateInput(name, kind).Set(tuple(value[:3]) if is_color else value)
    made.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    return made.GetPrim()


def correct(prims, data):
    for prim in prims:
        for attribute in prim.GetAttributes():
            if attribute.GetTypeName() == "asset" and (asset := attribute.Get()) and asset.path:
                _find(prim, attribute, asset, data)


# Inputs of OpenPBR that Blender's export makes of an input of a principled material.
COLOR_INPUTS = {
    "Base Color": ("base_color", "subsurface_color", "transmission_color"),
    "Emission Color": ("emission_color",),
}
# Nodes that read a colour attribute, and their property that names it.
COLOR_READERS = {"VERTEX_COLOR": "layer_name", "ATTRIBUTE": "attribute_name"}


def connect_color_attributes(shaders, data):
    """The export knows no colour attributes: where one is a principled material's colour, the shader is given it."""
    from pxr import UsdShade

    for prim in shaders:
        shader = UsdShade.Shader(prim)
        if shader.GetIdAttr().Get() != "ND_open_pbr_surface_surfaceshader":
            continue
        material = data.materials.get(_name_of_material(prim))
        tree = material.node_tree if material else None
        for node in tree.nodes if tree else ():
            if node.type == "BSDF_PRINCIPLED":
                _connect_colors(shader, node)


def _connect_colors(shader, principled):
    from pxr import Sdf

    for blenders, names in COLOR_INPUTS.items():
        links = principled.inputs[blenders].links
        source = links[0].from_node if links and links[0].from_socket.name == "Color" else None
        attribute = getattr(source, COLOR_READERS.get(source.type, ""), "") if source else ""
        if attribute:
            color = _read_color(shader.GetPrim(), blenders.split()[0].lower(), attribute)
            for name in names:
                shader.CreateInput(name, Sdf.ValueTypeNames.Color3f).ConnectToSource(color)


def _read_color(beside, name, attribute):
    """Nodes that read a colour of the geometry; returns what they give."""
    from pxr import Sdf, UsdShade

    stage, folder = beside.GetStage(), beside.GetPath().GetParentPath()
    reader, opaque = (UsdShade.Shader.Define(stage, folder.AppendChild(f"oocpt_{name}_{part}"))
                      for part in ("attribute", "color"))  # fmt: skip
    reader.CreateIdAttr("ND_geompropvalue_color4")
    reader.CreateInput("geomprop", Sdf.ValueTypeNames.String).Set(attribute)
    opaque.CreateIdAttr("ND_convert_color4_color3")
    read = reader.CreateOutput("out", Sdf.ValueTypeNames.Color4f)
    opaque.CreateInput("in", Sdf.ValueTypeNames.Color4f).ConnectToSource(read)
    return opaque.CreateOutput("out", Sdf.ValueTypeNames.Color3f)


def _find(prim, attribute, asset, data):
    """Writes the image of an asset that has no file, and names what was written."""
    from pxr import Sdf

    if pathlib.Path(asset.resolvedPath or asset.path).is_file():
        return
    wanted = pathlib.PurePath(asset.path.replace("\\", "/")).name
    candidates = [*_images_of(prim, data), *data.images.values()]
    image = next((one for one in candidates if wanted in _names(one)), None)
    try:
        written = _write(image.original) if image else None
    except OSError:
        # The renderer warns of a texture that it does not find.
        written = None
    if written:
        attribute.Set(Sdf.AssetPath(str(written)))


def _images_of(prim, data):
    """Images of the material that a shader is in: two images may have files of one name."""
    material = data.materials.get(_name_of_material(prim))
    return list(_images_in(material.node_tree)) if material and material.node_tree else []


def _name_of_material(prim):
    while prim and prim.GetTypeName() != "Material":
        prim = prim.GetParent()
    return prim.GetAttribute("userProperties:blender:data_name").Get() if prim else None


def _images_in(tree):
    """Also in groups, each once: they may be in each other many times over."""
    waiting, seen = [tree], set()
    while waiting:
        tree = waiting.pop()
        if tree.as_pointer() in seen:
            continue
        seen.add(tree.as_pointer())
        for node in tree.nodes:
            if getattr(node, "image", None):
                yield node.image
            if getattr(node, "node_tree", None):
                waiting.append(node.node_tree)


def _names(image):
    """Names of files that the exporter may give an image."""
    ending = ENDINGS.get(image.file_format, ".png")
    names = {image.name, image.name + ending, pathlib.PurePath(image.name).stem + ending}
    for path in (image.filepath, *(one.filepath for one in image.packed_files)):
        names.add(pathlib.PurePath(path.replace("\\", "/")).name)
    return names


def _write(image):
    """A file with the image's content; None if it has none. The same content is written once."""
    folder = pathlib.Path(bpy.app.tempdir) / "oocpt_textures"
    folder.mkdir(parents=True, exist_ok=True)
    if image.packed_file and not image.is_dirty:
        content = image.packed_file.data
        ending = pathlib.PurePath(image.filepath).suffix or ENDINGS.get(image.file_format, ".png")
        file = folder / (hashlib.blake2b(content, digest_size=16).hexdigest() + ending)
        if not file.is_file():
            file.write_bytes(content)
        return file
    if not image.has_data and image.source != "GENERATED":
        return None
    return _write_pixels(image, folder)


def _write_pixels(image, folder):
    """Of what was painted or generated. The name follows the pixels: a renderer keeps what it has read of a name."""
    import numpy

    pixels = numpy.empty(len(image.pixels), dtype=numpy.float32)
    if not len(pixels):
        return None
    image.pixels.foreach_get(pixels)
    ending = ".exr" if image.is_float else ".png"
    file = folder / (hashlib.blake2b(pixels.tobytes(), digest_size=16).hexdigest() + ending)
    if not file.is_file():
        copy = image.copy()
        try:
            copy.file_format = "OPEN_EXR" if image.is_float else "PNG"
            copy.pixels.foreach_set(pixels)
            copy.filepath_raw = str(file)
            copy.save()
        finally:
            bpy.data.images.remove(copy)
    return file if file.is_file() else None
