# SPDX-License-Identifier: Apache-2.0
"""Materials of the exported stage: textures without a file, and materials that were not exported.

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


def _find(prim, attribute, asset, data):
    """Writes the image of an asset that has no file, and names what was written."""
    from pxr import Sdf

    if pathlib.Path(asset.resolvedPath or asset.path).is_file():
        return
    wanted = pathlib.PurePath(asset.path.replace("\\", "/")).name
    candidates = [*_images_of(prim, data), *data.images.values()]
    image = next((one for one in candidates if wanted in _names(one)), None)
    written = _write(image.original) if image else None
    if written:
        attribute.Set(Sdf.AssetPath(str(written)))


def _images_of(prim, data):
    """Images of the material that a shader is in: two images may have files of one name."""
    while prim and prim.GetTypeName() != "Material":
        prim = prim.GetParent()
    named = prim.GetAttribute("userProperties:blender:data_name").Get() if prim else None
    material = data.materials.get(named)
    return list(_images_in(material.node_tree)) if material and material.node_tree else []


def _images_in(tree, depth=0):
    for node in tree.nodes:
        if getattr(node, "image", None):
            yield node.image
        # Groups may be nested, and a file may lie about how deep.
        if getattr(node, "node_tree", None) and depth < 16:
            yield from _images_in(node.node_tree, depth + 1)


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
