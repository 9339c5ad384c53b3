# SPDX-License-Identifier: Apache-2.0
"""Run by Blender's own Python module: renders a scene through a Hydra render engine with OocPT.

Arguments: the folder of Blender's module, the plugin's resources, the file to write (.npy: rows from the bottom, RGBA
in f32), the export method (HYDRA or USD). Beside it, in `.polls.npy`, when Blender asked whether it was done.
"""

import sys
import time

blender, resources, output, method = sys.argv[1:]
sys.path.insert(0, blender)

import bpy
import numpy as np
from materials import material

bpy.utils.expose_bundled_modules()
import pxr.Plug

pxr.Plug.Registry().RegisterPlugins([resources])


class Engine(bpy.types.HydraRenderEngine):
    bl_idname, bl_label, bl_delegate_id = "OOCPT", "OocPT", "HdOocPTRendererPlugin"
    bl_use_gpu_context, bl_use_materialx = False, True

    def get_render_settings(self, engine_type):
        return {"oocpt:samplesPerPixel": 16, "aovToken:Combined": "color"}

    def update_render_passes(self, scene, render_layer):
        self.register_pass(scene, render_layer, "Combined", 4, "RGBA", "COLOR")


bpy.utils.register_class(Engine)
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.engine, scene.hydra.export_method = "OOCPT", method
scene.render.resolution_x, scene.render.resolution_y = 96, 64
scene.view_settings.view_transform = "Standard"
scene.world = bpy.data.worlds.new("Sky")
scene.world.use_nodes = True
scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.5, 0.5, 0.5, 1.0)

camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
camera.data.type, camera.data.ortho_scale = "ORTHO", 6.0
camera.location = (0, 0, 10)
scene.collection.objects.link(camera)
scene.camera = camera


def sphere(x, dressed):
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.8, location=(x, 1, 0), segments=48, ring_count=24)
    bpy.context.object.data.materials.append(dressed)


sphere(-2, material("Red", Base_Color=(0.8, 0.05, 0.05, 1.0)))
sphere(0, material("Glow", Emission_Color=(0.0, 1.0, 0.0, 1.0), Emission_Strength=1.0, Base_Color=(0, 0, 0, 1)))
# Glass of index 1 is not there but for what is behind it.
sphere(2, material("Glass", Transmission_Weight=1.0, IOR=1.001, Roughness=0.0, Base_Color=(1, 1, 1, 1)))

# Instances: twelve blue cubes in a row.
collection = bpy.data.collections.new("Cubes")
bpy.ops.mesh.primitive_cube_add(size=0.3)
cube = bpy.context.object
cube.data.materials.append(material("Blue", Base_Color=(0.05, 0.05, 0.8, 1.0)))
for owner in list(cube.users_collection):
    owner.objects.unlink(cube)
collection.objects.link(cube)
for k in range(12):
    place = bpy.data.objects.new(f"Place{k}", None)
    place.instance_type, place.instance_collection = "COLLECTION", collection
    place.location = (-2.75 + 0.5 * k, -1, 0)
    scene.collection.objects.link(place)

scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
scene.render.filepath = output + ".exr"
polls = []
bpy.app.handlers.render_stats.append(lambda *_: polls.append(time.monotonic()))
bpy.ops.render.render(write_still=True)
np.save(output + ".polls", polls)
image = bpy.data.images.load(output + ".exr")
np.save(output, np.array(image.pixels[:], dtype=np.float32).reshape(64, 96, 4))
