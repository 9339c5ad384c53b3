# SPDX-License-Identifier: Apache-2.0
"""What the user sets: of the picture in the scene and its view layers, of the machine in the add-on's preferences. A
file from a stranger so chooses neither devices nor memory."""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from . import passes

MOST = 2**31 - 1
FILTERS = (
    ("box", "Box", "The square of the pixel"),
    ("triangle", "Triangle", ""),
    ("gaussian", "Gaussian", ""),
    ("blackman-harris", "Blackman-Harris", "A quarter of the aliasing of the box, a little more noise"),
    ("mitchell", "Mitchell-Netravali", "The sharpest, with a light rim beside what is dark"),
)
DENOISE = (
    ("off", "Off", "Pictures as they are"),
    ("final", "Last Picture", "Denoise the last picture"),
    ("interactive", "All Pictures", "Denoise pictures on the way, too"),
)
EXPORT = (
    ("USD", "USD", "Complete: lights, hair, packed textures and links as Blender has them. Instancing is kept"),
    ("HYDRA", "Hydra", "Fast where there are thousands of objects, but the camera sees lights, which reach everything, "
     "and panoramas are turned and have no strength"),
)  # fmt: skip


class OocPTSceneSettings(bpy.types.PropertyGroup):
    """`scene.oocpt`: what the picture is."""

    samples: IntProperty(name="Samples", description="Samples per pixel", default=128, min=1, max=1 << 24,
                         soft_max=8192)
    viewport_samples: IntProperty(name="Samples", description="Samples per pixel in the viewport", default=64, min=1,
                                  max=1 << 24, soft_max=8192)
    target_error: FloatProperty(name="Target Error", default=0.0, min=0.0, precision=5, step=1,
                                description="Stop when the relative mean square error is certainly below; 0 is off")
    time_limit: FloatProperty(name="Time Limit", description="Stop after this time; 0 is off", default=0.0, min=0.0,
                              max=1e9, unit="TIME_ABSOLUTE")
    adaptive: BoolProperty(name="Adaptive Sampling", default=False,
                           description="Spend samples where the relative error is largest, without bias")
    seed: IntProperty(name="Seed", description="Seed of the random numbers", default=0, min=0, max=MOST)
    animate_seed: BoolProperty(name="Animate Seed", description="Other noise in each frame", default=False)
    denoise: EnumProperty(name="Denoise", description="Denoise with Open Image Denoise", items=DENOISE[:2],
                          default="off")
    viewport_denoise: EnumProperty(name="Denoise", description="Denoise the viewport with Open Image Denoise",
                                   items=DENOISE, default="off")

    max_bounces: IntProperty(name="Total", description="Most bounces of a path; 0 is direct light alone", default=12,
                             min=0, max=1024)
    diffuse_bounces: IntProperty(name="Diffuse", description="Most diffuse bounces", default=1024, min=0, max=1024)
    specular_bounces: IntProperty(name="Specular", description="Most bounces off specular surfaces and hair",
                                  default=1024, min=0, max=1024)
    transmission_bounces: IntProperty(name="Transmission", description="Most bounces through surfaces, two a pane",
                                      default=1024, min=0, max=1024)
    clamp: FloatProperty(name="Clamp Indirect", default=0.0, min=0.0, soft_max=100.0,
                         description="Largest indirect contribution of a sample, which darkens the picture; 0 is off")

    filter: EnumProperty(name="Filter", description="Filter of the pixels", items=FILTERS, default="blackman-harris")
    filter_width: FloatProperty(name="Width", description="Full width in pixels; 0 is the usual one of the filter",
                                default=0.0, min=0.0, max=64.0)
    dicing_rate: FloatProperty(name="Dicing Rate", default=2.0, min=0.0, max=1e6, soft_min=0.5, soft_max=16.0,
                               description="How finely curves are cut, in pixels; Blender itself subdivides surfaces")

    light_linking: BoolProperty(name="Light Linking", default=True,
                                description="Lights reach what their light linking names; off: everything")
    export: EnumProperty(name="Final", description="How the scene reaches the renderer", items=EXPORT, default="USD")
    viewport_export: EnumProperty(name="Viewport", description="How the scene reaches the renderer in the viewport",
                                  items=EXPORT, default="USD")


class OocPTPassSettings(bpy.types.PropertyGroup):
    """`view_layer.oocpt`: passes that Blender has no switch for."""

    __annotations__ = {
        one.switch: BoolProperty(name=one.label, description=one.help, default=False) for one in passes.OURS
    }


class OocPTPreferences(bpy.types.AddonPreferences):
    """What belongs to the machine."""

    bl_idname = __package__

    device: StringProperty(name="Device", description="Vulkan device, by index or part of its name; empty is the best")
    memory: IntProperty(name="Device Memory", default=0, min=0, max=1 << 24, subtype="NONE",
                        description="Hard limit of device memory in MiB; 0 is 90 % of what is free")
    viewport_memory: IntProperty(name="Viewport", default=4096, min=0, max=1 << 24,
                                 description="Hard limit of device memory of a viewport in MiB, so that a final render "
                                 "and Blender have room beside it; 0 is 90 % of what is free")
    host_memory: IntProperty(name="Host Memory", default=0, min=0, max=1 << 24,
                             description="Limit of host memory in MiB, beside what Blender holds; 0 is what is free")

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        draw_machine(layout, self)


def draw_machine(layout, preferences):
    layout.prop(preferences, "device")
    column = layout.column(align=True)
    column.prop(preferences, "memory", text="Device Memory (MiB)")
    column.prop(preferences, "viewport_memory", text="Viewport (MiB)")
    column.prop(preferences, "host_memory", text="Host Memory (MiB)")


def preferences():
    """The add-on's preferences; None where it was not enabled as an add-on."""
    addon = bpy.context.preferences.addons.get(__package__)
    return addon.preferences if addon else None


def for_hydra(scene, view_layer, use, report):
    """Settings of the render delegate. `use` is FINAL, PREVIEW or VIEWPORT, `report` a file for its report."""
    chosen = scene.oocpt
    is_final, is_live = use == "FINAL", use == "VIEWPORT"
    settings = {
        "oocpt:samplesPerPixel": chosen.samples if is_final else chosen.viewport_samples,
        "oocpt:maxBounces": chosen.max_bounces,
        "oocpt:maxDiffuseBounces": chosen.diffuse_bounces,
        "oocpt:maxSpecularBounces": chosen.specular_bounces,
        "oocpt:maxTransmissionBounces": chosen.transmission_bounces,
        "oocpt:clamp": chosen.clamp,
        "oocpt:seed": chosen.seed + (scene.frame_current if chosen.animate_seed else 0) & MOST,
        "oocpt:pixelFilter": chosen.filter,
        "oocpt:pixelFilterWidth": chosen.filter_width,
        "oocpt:dicingRate": chosen.dicing_rate,
        "oocpt:denoise": chosen.denoise if is_final else chosen.viewport_denoise,
        "oocpt:timeLimit": chosen.time_limit if is_final else 0.0,
        "oocpt:targetError": chosen.target_error if is_final else 0.0,
        "oocpt:adaptiveSampling": chosen.adaptive if is_final else False,
        # Pictures on the way are of use where somebody sees them.
        "enableInteractive": is_live or not bpy.app.background,
        "domeLightCameraVisibility": not scene.render.film_transparent,
        "oocpt:products": False,
    }
    settings |= _of_machine(is_live)
    if report:
        settings["oocpt:report"] = report
    if not is_live:
        asked = passes.wanted(view_layer) if is_final else passes.PASSES[:1]
        settings |= {f"aovToken:{one.name}": one.image for one in asked}
    return settings


def _of_machine(is_live):
    """What is not set here the environment may set."""
    chosen = preferences()
    if chosen is None:
        return {}
    memory = chosen.viewport_memory if is_live else chosen.memory
    named = {"oocpt:device": chosen.device, "oocpt:memoryBudget": memory, "oocpt:hostMemoryBudget": chosen.host_memory}
    return {key: value for key, value in named.items() if value}


CLASSES = (OocPTSceneSettings, OocPTPassSettings, OocPTPreferences)


def register():
    for one in CLASSES:
        bpy.utils.register_class(one)
    bpy.types.Scene.oocpt = PointerProperty(type=OocPTSceneSettings)
    bpy.types.ViewLayer.oocpt = PointerProperty(type=OocPTPassSettings)


def unregister():
    del bpy.types.ViewLayer.oocpt, bpy.types.Scene.oocpt
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
