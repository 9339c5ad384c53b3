# SPDX-License-Identifier: Apache-2.0
"""Renders one frame for `oocpt.render`: `FOLDER DESCRIPTOR`. Reads FOLDER/request.json, leaves an array for each image
(0.npy and so on) and statistics.json, and writes the fraction that is done to the descriptor, a line each. What goes
wrong is on standard error, and the exit status is 1.

The rules by which a stage is opened and a camera found are usdrecord's own.
"""

from __future__ import annotations

import ctypes
import json
import math
import os
import sys
import time as clock

import numpy as np
from pxr import CameraUtil, Gf, Glf, Tf, Usd, UsdAppUtils, UsdGeom, UsdImagingGL

# Last: it looks for the loaded host.
import _aov_reader as aov_reader  # isort: skip
import _usdrecord as usdrecord  # isort: skip

RENDERER = "HdOocPTRendererPlugin"
OWN_CAMERA = "/OocPTCamera"
SECONDS_BETWEEN_REPORTS = 0.1
SECONDS_BETWEEN_STEPS = 0.002


class Scene:
    """What of the command line usdrecord's functions ask for."""

    mask = sessionLayer = renderPassPrimPath = renderSettingsPrimPath = None
    resolver = "root"

    def __init__(self, path):
        self.usdFilePath = path


def find_camera(stage, name, purposes, time):
    """The path of the camera that `oocpt.render` promises."""
    wanted = usdrecord.find_camera(stage, None, usdrecord.settings_prim_path(stage, Scene("")))
    cameras = [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Camera)]
    if name:
        found = UsdAppUtils.GetCameraAtPath(stage, name)
        if not found:
            known = ", ".join(str(prim.GetPath()) for prim in cameras[:8]) or "none"
            raise usdrecord.Failed(f"no camera {name} on the stage; there is {known}")
        return found.GetPath()
    if wanted:
        return wanted.GetPath()
    return cameras[0].GetPath() if len(cameras) == 1 else frame_all(stage, purposes, time)


def frame_all(stage, purposes, time):
    """Makes a camera in the session layer that sees all, from +z where y is up, from -y where z is."""
    cache = UsdGeom.BBoxCache(time, ["default", *purposes], useExtentsHint=True)
    bounds = cache.ComputeWorldBound(stage.GetPseudoRoot()).ComputeAlignedRange()
    if bounds.IsEmpty():
        raise usdrecord.Failed("there is nothing on the stage that a camera could see")
    camera = Gf.Camera()
    radius = max(bounds.GetSize().GetLength() / 2, 1e-6)
    away = radius / math.sin(math.radians(camera.GetFieldOfView(Gf.Camera.FOVVertical)) / 2)
    turn = Gf.Rotation(Gf.Vec3d(1, 0, 0), 90.0 if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z else 0.0)
    place = Gf.Matrix4d().SetTranslate(Gf.Vec3d(0, 0, away)) * Gf.Matrix4d().SetRotate(turn)
    camera.transform = place * Gf.Matrix4d().SetTranslate(bounds.GetMidpoint())
    camera.clippingRange = Gf.Range1f(max(away - 1.01 * radius, 1e-3 * radius), away + 1.01 * radius)
    stage.SetEditTarget(stage.GetSessionLayer())
    prim = UsdGeom.Camera.Define(stage, OWN_CAMERA)
    prim.SetFromCamera(camera, time)
    return prim.GetPath()


def open_engine(request, stage, signals):
    for key, value in request["settings"].items():
        wrong = signals.set(key, value)
        if wrong:
            raise usdrecord.Failed(wrong)
    if signals.plugin is not None:
        signals.plugin.HdOocPTRunnerTimeCodesPerSecond(ctypes.c_double(stage.GetTimeCodesPerSecond()))
    parameters = UsdImagingGL.Engine.Parameters()
    parameters.gpuEnabled = False
    parameters.rendererPluginId = RENDERER
    engine = UsdImagingGL.Engine(parameters)
    if engine.GetCurrentRendererId() != RENDERER and not engine.SetRendererPlugin(RENDERER):
        raise usdrecord.Failed("the renderer OocPT cannot be used on this machine; see the messages above")
    return engine


def set_picture(engine, request, stage, camera, time):
    width, height = request["width"], request["height"]
    if height is None:
        # As UsdAppUtils.FrameRecorder has it: single precision, rounded down.
        aspect = np.float32(UsdGeom.Camera(stage.GetPrimAtPath(camera)).GetCamera(time).aspectRatio)
        height = max(int(np.float32(width) / aspect), 1) if aspect > 0 else width
    engine.SetRenderBufferSize(Gf.Vec2i(width, height))
    engine.SetFraming(CameraUtil.Framing(Gf.Rect2i(Gf.Vec2i(0, 0), width, height)))
    engine.SetCameraPath(camera)
    if request["camera_light"]:
        light_from_camera(engine, UsdGeom.Camera(stage.GetPrimAtPath(camera)).GetCamera(time))
    if not aov_reader.set_aovs(engine, request["aovs"]):
        raise usdrecord.Failed(f"the renderer does not have all of the images {', '.join(request['aovs'])}")


def light_from_camera(engine, camera):
    """The light that UsdAppUtils.FrameRecorder puts at the camera."""
    place = camera.transform.ExtractTranslation()
    light = Glf.SimpleLight()
    light.position = Gf.Vec4f(place[0], place[1], place[2], 1.0)
    light.transform = camera.frustum.ComputeViewInverse()
    engine.SetLightingState([light], Glf.SimpleMaterial(), Gf.Vec4f(0.01, 0.01, 0.01, 1.0))


def parameters_of(request, time):
    params = UsdImagingGL.RenderParams()
    params.frame = time
    params.complexity = 1.0
    params.enableLighting = params.enableSceneMaterials = True
    params.clearColor = Gf.Vec4f(0, 0, 0, 0)
    params.showGuides, params.showProxy, params.showRender = (
        purpose in request["purposes"] for purpose in ("guide", "proxy", "render")
    )
    return params


def finish(engine, stage, params, descriptor):
    """Draws until the picture is done, and says how far it is meanwhile."""
    told = 0.0
    while True:
        engine.Render(stage.GetPseudoRoot(), params)
        if engine.IsConverged():
            os.write(descriptor, b"1.0\n")
            return
        if clock.monotonic() - told > SECONDS_BETWEEN_REPORTS:
            told = clock.monotonic()
            done = float(dict(engine.GetRenderStats()).get("percentDone", 0.0)) / 100
            os.write(descriptor, f"{min(max(done, 0.0), 1.0)}\n".encode())
        clock.sleep(SECONDS_BETWEEN_STEPS)


def save(engine, request, folder):
    for at, name in enumerate(request["aovs"]):
        array = aov_reader.read(engine, name)
        if array is None:
            raise usdrecord.Failed(f"the renderer has no image {name}")
        np.save(os.path.join(folder, f"{at}.npy"), np.ascontiguousarray(array[::-1]), allow_pickle=False)
    statistics = {str(key): value for key, value in dict(engine.GetRenderStats()).items()}
    with open(os.path.join(folder, "statistics.json"), "w", encoding="utf-8") as file:
        json.dump(statistics, file, default=str)


def render(folder, descriptor, signals):
    with open(os.path.join(folder, "request.json"), encoding="utf-8") as file:
        request = json.load(file)
    stage = usdrecord.open_stage(Scene(request["scene"]))
    usdrecord.KEPT.append(stage)
    time = Usd.TimeCode.EarliestTime() if request["time"] is None else Usd.TimeCode(request["time"])
    camera = find_camera(stage, request["camera"], request["purposes"], time)
    engine = open_engine(request, stage, signals)
    usdrecord.KEPT.append(engine)
    set_picture(engine, request, stage, camera, time)
    finish(engine, stage, parameters_of(request, time), descriptor)
    save(engine, request, folder)


def main(folder, descriptor):
    signals = usdrecord.Signals()
    signals.listen()
    try:
        render(folder, int(descriptor), signals)
    except usdrecord.Failed as failure:
        print(failure, file=sys.stderr)
        return 1
    except Tf.ErrorException as error:
        print(usdrecord.sentences(error), file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    usdrecord.leave(main(*sys.argv[1:]))
