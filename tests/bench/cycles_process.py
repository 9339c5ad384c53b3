# SPDX-License-Identifier: Apache-2.0
"""Run by Blender's own Python module: imports a USD file and renders it by Cycles.

Arguments: the folder of Blender's module, a JSON file with what to do. A line of JSON on standard output for the import
and for each render. The scene is imported once; each render makes Cycles' scene and trees anew, as a frame does.
"""

from __future__ import annotations

import json
import math
import pathlib
import resource
import sys
import time


def tell(**said) -> None:
    print("RESULT " + json.dumps(said), flush=True)


def area_of(light) -> float:
    """Of a lamp's surface, in its own units."""
    if light.type == "POINT":
        return 4 * math.pi * light.shadow_soft_size**2
    if light.shape in ("SQUARE", "RECTANGLE"):
        return light.size * (light.size_y if light.shape == "RECTANGLE" else light.size)
    return math.pi / 4 * light.size * (light.size_y if light.shape == "ELLIPSE" else light.size)


def as_defined(light, unit: float, is_normalized: bool) -> None:
    """Gives a light the power that OpenUSD defines. The importer of Blender 5.0.1 takes every lamp as normalized, suns
    four times as strong and twice as wide."""
    if light.type == "SUN":
        light.angle /= 2
        light.energy *= 0.25 * (1.0 if is_normalized else math.pi * math.sin(light.angle / 2) ** 2)
    elif light.type in ("POINT", "AREA") and not is_normalized:
        light.energy *= area_of(light) * unit**2


def imported(bpy, job: dict) -> None:
    start = time.monotonic()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    # The importer puts a dome light into the world that there is.
    bpy.context.scene.world = bpy.data.worlds.new("World")
    bpy.ops.wm.usd_import(
        filepath=job["scene"], import_subdivision=True, support_scene_instancing=True, import_visible_only=True,
        import_guide=False, import_proxy=False, import_render=True, set_frame_range=False,
        apply_unit_conversion_scale=True, import_textures_mode="IMPORT_NONE",
    )  # fmt: skip
    for light in bpy.data.objects:
        if light.type == "LIGHT":
            as_defined(light.data, job["unit"], light.name in job["normalized"])
    bpy.context.view_layer.update()
    kinds: dict[str, int] = {}
    for one in bpy.data.objects:
        kinds[one.type] = kinds.get(one.type, 0) + 1
    depsgraph = bpy.context.evaluated_depsgraph_get()
    instances = sum(1 for one in depsgraph.object_instances if one.is_instance)
    files = [image for image in bpy.data.images if image.source in ("FILE", "TILED")]
    lost = [image.filepath for image in files if not image.has_data and image.size[0] == 0]
    tell(
        kind="import", seconds=time.monotonic() - start, objects=kinds, instances=instances,
        materials=len(bpy.data.materials), images=len(bpy.data.images), lost_images=lost[:10],
        version=bpy.app.version_string,
    )  # fmt: skip


def set_up(bpy, job: dict) -> None:
    scene = bpy.context.scene
    cameras = [one for one in bpy.data.objects if one.type == "CAMERA"]
    named = [one for one in cameras if one.name == job["camera"].rsplit("/", 1)[-1]]
    scene.camera = (named or cameras)[0]
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = job["width"], job["height"]
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.image_settings.exr_codec = "ZIP"
    scene.render.use_motion_blur = bool(job["shutter"])
    if job["shutter"]:
        scene.render.motion_blur_shutter = job["shutter"]
        scene.render.motion_blur_position = "CENTER"
    if job["frame"]:
        scene.frame_set(int(float(job["frame"])))
    cycles = scene.cycles
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    cycles.pixel_filter_type = "BOX"
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    for name in ("max_bounces", "diffuse_bounces", "glossy_bounces", "transmission_bounces"):
        setattr(cycles, name, job["bounces"])
    cycles.transparent_max_bounces = 128
    cycles.device = _device(bpy)
    tell(kind="device", device=cycles.device)


def _device(bpy) -> str:
    """A GPU by OptiX or CUDA if Cycles finds one."""
    settings = bpy.context.preferences.addons["cycles"].preferences
    for kind in ("OPTIX", "CUDA"):
        try:
            settings.compute_device_type = kind
            settings.get_devices_for_type(kind)
        except (TypeError, ValueError):
            continue
        if any(device.type == kind for device in settings.devices):
            for device in settings.devices:
                device.use = device.type == kind
            return "GPU"
    return "CPU"


def main() -> None:
    folder, job_file = sys.argv[1:]
    sys.path.insert(0, folder)
    import bpy

    job = json.loads(pathlib.Path(job_file).read_text())
    import addon_utils

    addon_utils.enable("cycles")
    imported(bpy, job)
    addon_utils.enable("cycles")
    set_up(bpy, job)
    scene = bpy.context.scene
    for samples, seed in job["renders"]:
        scene.cycles.samples, scene.cycles.seed = samples, seed
        scene.render.filepath = str(pathlib.Path(job["out"]) / f"{samples}-{seed}.exr")
        before = sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
        start = time.monotonic()
        bpy.ops.render.render(write_still=True)
        tell(
            kind="render", samples=samples, seed=seed, seconds=time.monotonic() - start,
            cpu=sum(resource.getrusage(resource.RUSAGE_SELF)[:2]) - before,
        )  # fmt: skip


if __name__ == "__main__":
    main()
