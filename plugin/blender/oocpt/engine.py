# SPDX-License-Identifier: Apache-2.0
"""The render engine: Blender's `HydraRenderEngine` with OocPT's delegate, and with what goes wrong told in words."""

import os
import pathlib

import bpy

from . import passes, plugin, progress, settings, stage


class OocPTRenderEngine(bpy.types.HydraRenderEngine):
    bl_idname = "OOCPT"
    bl_label = "OocPT"
    bl_delegate_id = plugin.DELEGATE

    bl_use_preview = True
    bl_use_eevee_viewport = True
    bl_use_gpu_context = False
    bl_use_materialx = True

    # ---- pictures and material previews; Blender calls these in a thread of its own ----

    def update(self, data, depsgraph):
        self.fault = _not_rendered(depsgraph) or self._hand_over(depsgraph, None, "PREVIEW")
        if self.fault:
            self._tell_fault()

    def render(self, depsgraph):
        if self.fault or not self.engine_ptr:
            return
        import _bpy_hydra
        from pxr import Tf

        scene = depsgraph.scene
        title = f"{scene.name}: {depsgraph.view_layer.name}"
        mark = Tf.Error.Mark()
        with progress.RenderProgress(_report_file(self), title, self._show) as seen:
            _bpy_hydra.engine_render(self.engine_ptr)
        self.fault = "; ".join(error.commentary for error in mark.GetErrors())
        mark.Clear()
        if self.fault:
            self._tell_fault()
        elif not self.is_preview and not self.test_break():
            self._finish(depsgraph, seen)

    def _show(self, share, text):
        if not self.is_preview:
            self.update_progress(share)
            self.update_stats("", text)

    def _finish(self, depsgraph, seen):
        self._finish_depth(depsgraph)
        summary = seen.summary()
        result = self.get_result()
        for key, value in summary.items():
            result.stamp_data_add_field(f"oocpt:{key}", value)
        if depsgraph.scene.render.use_motion_blur:
            self.report({"WARNING"}, "OocPT: Blender hands no motion blur to Hydra; what moves is sharp")
        if summary:
            self.report({"INFO"}, "OocPT: " + ", ".join(f"{key} {value}" for key, value in summary.items()))

    def _finish_depth(self, depsgraph):
        """In the result itself: what `begin_result` gives would replace every pass."""
        layer = self.get_result().layers.get(depsgraph.view_layer.name)
        width, height = _rendered_size(depsgraph.scene.render)
        for one in layer.passes if layer else ():
            if one.name == "Depth":
                passes.put_far_what_is_not_seen(one, width * height)

    def _tell_fault(self):
        """A picture that was not rendered is never finished: the report fails the operator, and nothing is written;
        what `error_set` is given stands over the picture."""
        text = self.fault if self.fault.startswith("OocPT: ") else f"OocPT: {self.fault}"
        self.report({"ERROR"}, text)
        self.error_set(text)

    # ---- the viewport ----

    def view_update(self, context, depsgraph):
        self.fault = self._hand_over(depsgraph, context, "VIEWPORT")
        if self.fault:
            self.update_stats("OocPT", self.fault)

    def view_draw(self, context, depsgraph):
        if self.engine_ptr and not self.fault:
            super().view_draw(context, depsgraph)

    # ---- both ----

    def get_render_settings(self, engine_type):
        """What HydraRenderEngine asks for; `_hand_over` asks for itself."""
        scene, layer = bpy.context.scene, bpy.context.view_layer
        return settings.for_hydra(scene, layer, engine_type, "")

    def update_render_passes(self, scene, render_layer):
        for one in passes.wanted(render_layer):
            self.register_pass(scene, render_layer, one.name, len(one.channels), one.channels, one.kind)

    def _hand_over(self, depsgraph, context, kind):
        """Gives scene and settings to the delegate, which is made when it is first needed. Returns what went wrong.

        Of Blender's engines for pictures, PREVIEW is the one that leaves telling its progress to others.
        """
        import _bpy_hydra
        from pxr import Tf

        mark = Tf.Error.Mark()
        if not self.engine_ptr:
            if fault := plugin.fault():
                return fault
            self.engine_ptr = _bpy_hydra.engine_create(self, kind, self.bl_delegate_id)
            if not self.engine_ptr:
                return _told(mark) or "Blender could not make the render delegate"
        scene = depsgraph.scene_eval
        use = "VIEWPORT" if context else "PREVIEW" if self.is_preview else "FINAL"
        scene.hydra.export_method = scene.oocpt.viewport_export if context else scene.oocpt.export
        with stage.exporting(depsgraph, scene.render.film_transparent), stage.lights_as_they_are(depsgraph):
            _bpy_hydra.engine_update(self.engine_ptr, depsgraph, context)
        report = "" if context else _report_file(self)
        for key, value in settings.for_hydra(scene, depsgraph.view_layer, use, report).items():
            _bpy_hydra.engine_set_render_setting(self.engine_ptr, key, value)
        return _told(mark)


def _told(mark):
    """The errors since a mark, which are then told once and not on the console again."""
    text = "; ".join(error.commentary for error in mark.GetErrors())
    mark.Clear()
    return text


def _not_rendered(depsgraph):
    """What would give a wrong picture instead of none."""
    camera = depsgraph.scene.camera
    if camera is None:
        return "the scene has no camera"
    if camera.type == "CAMERA" and camera.data.type in {"PANO", "CUSTOM"}:
        return "panoramic cameras are not rendered: Blender hands them to Hydra as perspective ones"
    return None


def _rendered_size(render):
    """Pixels of the picture, or of its border, as Blender's engine rounds them."""
    size = [side * render.resolution_percentage // 100 for side in (render.resolution_x, render.resolution_y)]
    if not render.use_border:
        return size
    border = (render.border_max_x - render.border_min_x, render.border_max_y - render.border_min_y)
    return [int(side * share) for side, share in zip(size, border, strict=True)]


def _report_file(engine):
    """Where the delegate writes its report: where the user wants it, else a file of this engine's own."""
    own = pathlib.Path(bpy.app.tempdir) / f"oocpt-{engine.as_pointer():x}.jsonl"
    return os.environ.get("OOCPT_REPORT") or str(own)


def register():
    bpy.utils.register_class(OocPTRenderEngine)


def unregister():
    bpy.utils.unregister_class(OocPTRenderEngine)
