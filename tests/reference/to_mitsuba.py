#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Renders a USD scene with Mitsuba 3: an independent second opinion, a test tool and never a part of the product.

    to_mitsuba.py SCENE OUT.exr [--picture OUT.png] [--width 640] [--samples 256] [--bounces 5] [--seed 0] [--camera
        /World/Camera]

Runs in the environment that `cargo xtask reference` makes (mitsuba, usd-core, numpy). Same pixels as `usdrecord`: box
filter, vertical fit. How materials and lights are mapped stands in materials.py, standard_surface.py and lights.py;
what could not be is printed, one line each.
"""

from __future__ import annotations

import argparse
import math
import os
import pathlib
import sys
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import mitsuba as mi  # noqa: E402
import numpy as np  # noqa: E402

# The modules below make Mitsuba objects: the variant comes first.
mi.set_variant(os.environ.get("OOCPT_MITSUBA_VARIANT", "llvm_ad_rgb"))

from pxr import Usd, UsdGeom  # noqa: E402

import lights  # noqa: E402
import materials  # noqa: E402
import networks  # noqa: E402
import standard_surface  # noqa: E402
import usd_scene  # noqa: E402


def _shape(number: int, part: usd_scene.Part, notes: list[str]):
    """A Mitsuba mesh with its BSDF and, if it glows, its emitter."""
    count = len(part.points)
    properties = mi.Properties()
    constant = part.colors is None or (part.colors == part.colors[0]).all()
    values = None
    if part.material is not None and networks.surface(part.material) is not None:
        values = networks.inputs(part.material, materials.decode, notes)
        properties["bsdf"] = mi.load_dict(materials.bsdf(values, notes))
    elif part.material is not None and standard_surface.surface(part.material) is not None:
        properties["bsdf"] = mi.load_dict(standard_surface.bsdf(part.material, notes))
    else:
        color = None if part.colors is None else (part.colors[0] if constant else "varying")
        properties["bsdf"] = mi.load_dict(materials.unbound(color, part.opacity))
    if values is not None and (isinstance(values["emissiveColor"], networks.Picture) or any(values["emissiveColor"])):
        properties["emitter"] = mi.load_dict(
            {"type": "area", "radiance": materials.texture(values["emissiveColor"], notes)}
        )
    mesh = mi.Mesh(
        f"part{number}", count, count // 3, has_vertex_normals=part.normals is not None,
        has_vertex_texcoords=part.st is not None, props=properties,
    )
    if not constant:
        mesh.add_attribute("vertex_color", 3, np.ascontiguousarray(part.colors, np.float32).ravel())
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.ascontiguousarray(part.points, np.float32).ravel()
    parameters["faces"] = np.arange(count, dtype=np.uint32)
    if part.normals is not None:
        parameters["vertex_normals"] = np.ascontiguousarray(part.normals, np.float32).ravel()
    if part.st is not None:
        parameters["vertex_texcoords"] = np.ascontiguousarray(part.st[:, :2], np.float32).ravel()
    parameters.update()
    return mesh


def sensor(stage: Usd.Stage, path: str, width: int, height: int, samples: int, seed: int, sampler: str) -> dict:
    """The camera as a sensor: window matched vertically, as OpenUSD's tools do."""
    camera = UsdGeom.Camera(stage.GetPrimAtPath(path)).GetCamera(Usd.TimeCode.Default())
    if camera.fStop:
        raise SystemExit(f"{path}: depth of field is not translated")
    window = camera.frustum.window
    half = (window.max[1] - window.min[1]) / 2
    # Mitsuba's camera looks along +z with +x to the left.
    place = usd_scene.columns(camera.transform) @ np.diag([-1.0, 1.0, -1.0, 1.0])
    made = {
        "film": {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"},
            "pixel_format": "rgb", "component_format": "float32"},
        "sampler": {"type": sampler, "sample_count": samples, "seed": seed},
        "near_clip": 1e-3, "far_clip": 1e6,
    }  # fmt: skip
    if camera.projection == camera.Orthographic:
        place = place @ np.diag([half * width / height, half * width / height, 1.0, 1.0])
        return {"type": "orthographic", "to_world": mi.ScalarTransform4f(place), **made}
    shift = [
        camera.horizontalApertureOffset / camera.verticalAperture * height / width,
        -camera.verticalApertureOffset / camera.verticalAperture,
    ]
    return {
        "type": "perspective", "fov": 2 * math.degrees(math.atan(half)), "fov_axis": "y",
        "to_world": mi.ScalarTransform4f(place), "principal_point_offset_x": -shift[0],
        "principal_point_offset_y": -shift[1], **made,
    }


def translate(
    path,
    width: int,
    height: int | None = None,
    camera="/World/Camera",
    samples=64,
    bounces=5,
    seed=0,
    hide=False,
    sampler="independent",
    blocks=True,
    roulette=1000,
):
    """(Mitsuba scene, notes). `bounces` are indirect bounces, as `oocpt:maxBounces`; `hide` keeps lights out of the
    camera's sight, `blocks` off out of all rays' ways. `roulette`: depth from which paths end at random."""
    stage = path if isinstance(path, Usd.Stage) else Usd.Stage.Open(str(path))
    scene = usd_scene.read(stage)
    parts = usd_scene.merged(scene.parts)
    corners = np.concatenate([part.points for part in parts]) if parts else np.zeros((1, 3))
    low, high = corners.min(axis=0), corners.max(axis=0)
    center, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    if height is None:
        window = UsdGeom.Camera(stage.GetPrimAtPath(camera)).GetCamera(Usd.TimeCode.Default()).frustum.window
        height = round(width * (window.max[1] - window.min[1]) / (window.max[0] - window.min[0]))
    shapes = [_shape(number, part, scene.notes) for number, part in enumerate(parts)]
    # `path` counts holes as bounces and its shadow rays stop at them; `volpath` goes through.
    holes = any("Mask[" in str(shape.bsdf()) or "Null" in str(shape.bsdf()) for shape in shapes)
    made = {
        "type": "scene",
        "integrator": {
            "type": "volpath" if holes or (scene.lamps and not blocks) else "path", "max_depth": bounces + 2,
            "rr_depth": roulette, "hide_emitters": hide,
        },
        "sensor": sensor(stage, camera, width, height, samples, seed, sampler),
    }
    for number, shape in enumerate(shapes):
        made[f"part{number}"] = shape
    for number, lamp in enumerate(scene.lamps):
        emitter = lights.emitter(lamp, center, max(radius, 1.0), scene.notes, blocks)
        if emitter is not None:
            made[f"lamp{number}"] = emitter
    return mi.load_dict(made), list(dict.fromkeys(scene.notes))


def render(scene, samples: int, seed: int = 0, at_once: int = 1 << 27) -> np.ndarray:
    """(height, width, 3) float64, row 0 at the top; `at_once` bounds the samples of one launch."""
    width, height = scene.sensors()[0].film().crop_size()
    piece = max(1, min(samples, at_once // (width * height)))
    total, done = np.zeros((height, width, 3)), 0
    while done < samples:
        count = min(piece, samples - done)
        total += count * np.array(mi.render(scene, spp=count, seed=seed * 100003 + done), dtype=np.float64)[..., :3]
        done += count
    return total / samples


def tone(linear: np.ndarray) -> np.ndarray:
    """sRGB, 8 bits."""
    linear = np.clip(linear, 0, 1)
    return np.rint(255 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)).astype(
        np.uint8
    )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("scene")
    parser.add_argument("out")
    parser.add_argument("--picture", help="also an 8-bit picture")
    parser.add_argument("--camera", default="/World/Camera")
    for name, default in (("width", 640), ("samples", 256), ("bounces", 5), ("seed", 0)):
        parser.add_argument(f"--{name}", type=int, default=default)
    arguments = parser.parse_args()
    start = time.monotonic()
    scene, notes = translate(
        arguments.scene, arguments.width, camera=arguments.camera, samples=arguments.samples, bounces=arguments.bounces
    )
    for note in notes:
        print(f"note: {note}", file=sys.stderr)
    ready = time.monotonic()
    picture = render(scene, arguments.samples, arguments.seed)
    print(f"{ready - start:.1f} s to translate, {time.monotonic() - ready:.1f} s to render", file=sys.stderr)
    bitmap = mi.Bitmap(picture.astype(np.float32))
    # As OocPT's own pictures say it (`oocpt report picture`).
    said = {
        "renderer": f"Mitsuba {mi.__version__} ({mi.variant()})", "samples": arguments.samples,
        "maxBounces": arguments.bounces, "seed": arguments.seed, "seconds": time.monotonic() - start,
        "secondsTracing": time.monotonic() - ready,
    }
    for name, value in said.items():
        bitmap.metadata()[f"oocpt:{name}"] = value
    bitmap.write(arguments.out)
    if arguments.picture:
        mi.Bitmap(tone(picture)).write(arguments.picture)


if __name__ == "__main__":
    main()
