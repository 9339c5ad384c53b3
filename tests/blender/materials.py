# SPDX-License-Identifier: Apache-2.0
"""What the programs that run in Blender share. Imported once `bpy` can be."""

import bpy


def material(name, **inputs):
    """A principled material; the inputs are named as in Blender, with underscores for blanks."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    for key, value in inputs.items():
        made.node_tree.nodes["Principled BSDF"].inputs[key.replace("_", " ")].default_value = value
    return made
