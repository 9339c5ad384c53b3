# SPDX-License-Identifier: Apache-2.0
"""Loads the Hydra plugin that lies beside this file, and says in words why it cannot be loaded."""

import ctypes
import os
import pathlib

import bpy

from . import pins

DELEGATE = "HdOocPTRendererPlugin"
FOLDER = pathlib.Path(__file__).resolve().parent / "plugin"
LIBRARIES_OF_MATERIALX = "PXR_MTLX_STDLIB_SEARCH_PATHS"


def prepare():
    """Makes the plugin known to Blender's OpenUSD. What is wrong is told when something is rendered."""
    bpy.utils.expose_bundled_modules()
    _find_materialx()
    from pxr import Plug

    # `OOCPT_BLENDER_PLUGIN` is a plugin that was built in a clone.
    folder = pathlib.Path(os.environ.get("OOCPT_BLENDER_PLUGIN", FOLDER))
    Plug.Registry().RegisterPlugins([str(folder / "hdOocPT" / "resources")])


def _find_materialx():
    """Without MaterialX's definitions of nodes materials are grey. OpenUSD reads the variable when it first needs them,
    which is after this."""
    if os.environ.get(LIBRARIES_OF_MATERIALX):
        return
    module = getattr(bpy, "__file__", None)
    near = [bpy.app.binary_path, module and pathlib.Path(module).parent / "_", bpy.utils.resource_path("LOCAL")]
    for place in filter(None, near):
        libraries = pathlib.Path(place).parent / "lib" / "materialx" / "libraries"
        if libraries.is_dir():
            os.environ[LIBRARIES_OF_MATERIALX] = str(libraries)
            return


def fault():
    """Why the plugin cannot render here, in a sentence; None if nothing is known to be wrong."""
    from pxr import Plug, Tf, Usd

    if Usd.GetVersion() != pins.OPENUSD:
        wanted, found = (".".join(map(str, version[1:])) for version in (pins.OPENUSD, Usd.GetVersion()))
        return f"this build of OocPT is for the OpenUSD {wanted} of Blender {pins.BLENDER}, this Blender has {found}"
    known = Plug.Registry().GetPluginWithName("hdOocPT")
    if not known or Tf.Type.FindByName(DELEGATE).isUnknown:
        return f"the plugin hdOocPT is not in {FOLDER}: install the extension again"
    library = pathlib.Path(known.path)
    if not library.is_file():
        return f"{library} is missing: install the extension again"
    try:
        ctypes.CDLL(str(library))
    except OSError as error:
        # The loader names the library or the version that the system lacks.
        return f"the plugin cannot be loaded: {error}"
    return None
