# SPDX-License-Identifier: Apache-2.0
"""Panels of the properties editor: OocPT's own, and those of Blender that hold for it."""

import bpy

from . import passes, settings
from .engine import OocPTRenderEngine

ENGINE = OocPTRenderEngine.bl_idname
# Of the panels for every renderer: what OocPT has another panel for, or does not read.
NOT_OURS = {
    "RENDER_PT_stamp", "DATA_PT_light", "DATA_PT_spot", "NODE_DATA_PT_light", "DATA_PT_falloff_curve",
    "SCENE_PT_audio",
}  # fmt: skip
# Of Eevee's panels: nodes of materials and worlds, and lenses, which are the same for all renderers.
FROM_EEVEE = {
    "MATERIAL_PT_preview", "EEVEE_MATERIAL_PT_context_material", "EEVEE_MATERIAL_PT_surface", "EEVEE_WORLD_PT_surface",
    "DATA_PT_camera_dof", "DATA_PT_camera_dof_aperture",
}  # fmt: skip


class OocPTPanel:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES

    def draw(self, context):
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        self.draw_rows(self.layout, context)

    def draw_rows(self, layout, context):
        """Panels that only hold others have none."""


class OOCPT_RENDER_PT_sampling(OocPTPanel, bpy.types.Panel):
    bl_label = "Sampling"


class OOCPT_RENDER_PT_sampling_viewport(OocPTPanel, bpy.types.Panel):
    bl_label = "Viewport"
    bl_parent_id = "OOCPT_RENDER_PT_sampling"

    def draw_rows(self, layout, context):
        chosen = context.scene.oocpt
        layout.prop(chosen, "viewport_samples")
        layout.prop(chosen, "viewport_denoise")


class OOCPT_RENDER_PT_sampling_render(OocPTPanel, bpy.types.Panel):
    bl_label = "Render"
    bl_parent_id = "OOCPT_RENDER_PT_sampling"

    def draw_rows(self, layout, context):
        chosen = context.scene.oocpt
        layout.prop(chosen, "samples")
        column = layout.column(align=True)
        column.prop(chosen, "target_error")
        column.prop(chosen, "time_limit")
        layout.prop(chosen, "adaptive")
        layout.prop(chosen, "denoise")


class OOCPT_RENDER_PT_sampling_advanced(OocPTPanel, bpy.types.Panel):
    bl_label = "Advanced"
    bl_parent_id = "OOCPT_RENDER_PT_sampling"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_rows(self, layout, context):
        chosen = context.scene.oocpt
        layout.prop(chosen, "seed")
        layout.prop(chosen, "animate_seed")
        layout.prop(chosen, "dicing_rate")


class OOCPT_RENDER_PT_paths(OocPTPanel, bpy.types.Panel):
    bl_label = "Light Paths"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_rows(self, layout, context):
        chosen = context.scene.oocpt
        column = layout.column(align=True)
        for name in ("max_bounces", "diffuse_bounces", "specular_bounces", "transmission_bounces"):
            column.prop(chosen, name)
        layout.prop(chosen, "clamp")
        layout.prop(chosen, "light_linking")


class OOCPT_RENDER_PT_film(OocPTPanel, bpy.types.Panel):
    bl_label = "Film"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_rows(self, layout, context):
        chosen = context.scene.oocpt
        layout.prop(context.scene.render, "film_transparent", text="Transparent Background")
        layout.prop(chosen, "filter")
        layout.prop(chosen, "filter_width")


class OOCPT_RENDER_PT_performance(OocPTPanel, bpy.types.Panel):
    bl_label = "Performance"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_rows(self, layout, context):
        if machine := settings.preferences():
            settings.draw_machine(layout, machine)
        column = layout.column(heading="Export")
        column.prop(context.scene.oocpt, "export")
        column.prop(context.scene.oocpt, "viewport_export")


class OOCPT_RENDER_PT_passes(OocPTPanel, bpy.types.Panel):
    bl_label = "Passes"
    bl_context = "view_layer"

    def draw_rows(self, layout, context):
        layer = context.view_layer
        column = layout.column(heading="Include", align=True)
        for one in passes.PASSES:
            column.prop(layer.oocpt if one.is_ours else layer, one.switch)


class OOCPT_LIGHT_PT_light(OocPTPanel, bpy.types.Panel):
    bl_label = "Light"
    bl_context = "data"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.light

    def draw_rows(self, layout, context):
        light = context.light
        layout.row().prop(light, "type", expand=True)
        row = layout.column(heading="Temperature").row(align=True)
        row.prop(light, "use_temperature", text="")
        temperature = row.row()
        temperature.active = light.use_temperature
        temperature.prop(light, "temperature", text="")
        layout.prop(light, "color", text="Tint" if light.use_temperature else "Color")
        layout.prop(light, "energy")
        layout.prop(light, "exposure")
        layout.prop(light, "normalize")
        self._draw_shape(layout, light)
        layout.prop(light, "use_shadow", text="Cast Shadow")

    def _draw_shape(self, layout, light):
        if light.type in {"POINT", "SPOT"}:
            layout.prop(light, "shadow_soft_size", text="Radius")
        if light.type == "SPOT":
            column = layout.column(align=True)
            column.prop(light, "spot_size", text="Angle", slider=True)
            column.prop(light, "spot_blend", slider=True)
            layout.prop(light, "show_cone")
        if light.type == "SUN":
            layout.prop(light, "angle")
        if light.type == "AREA":
            column = layout.column(align=True)
            column.prop(light, "shape")
            column.prop(light, "size")
            if light.shape in {"RECTANGLE", "ELLIPSE"}:
                column.prop(light, "size_y")


CLASSES = (
    OOCPT_RENDER_PT_sampling,
    OOCPT_RENDER_PT_sampling_viewport,
    OOCPT_RENDER_PT_sampling_render,
    OOCPT_RENDER_PT_sampling_advanced,
    OOCPT_RENDER_PT_paths,
    OOCPT_RENDER_PT_film,
    OOCPT_RENDER_PT_performance,
    OOCPT_RENDER_PT_passes,
    OOCPT_LIGHT_PT_light,
)


def _of_blender():
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", ())
        is_for_all = "BLENDER_RENDER" in engines and panel.__name__ not in NOT_OURS
        # Simpler meshes, which the export knows nothing of; lines drawn on top, by a renderer of their own.
        is_for_all = is_for_all and not any(word in panel.__name__ for word in ("simplify", "freestyle"))
        if is_for_all or "BLENDER_EEVEE" in engines and panel.__name__ in FROM_EEVEE:
            yield panel


def register():
    for one in CLASSES:
        bpy.utils.register_class(one)
    for panel in _of_blender():
        panel.COMPAT_ENGINES.add(ENGINE)


def unregister():
    for panel in _of_blender():
        panel.COMPAT_ENGINES.discard(ENGINE)
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
