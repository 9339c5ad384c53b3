# SPDX-License-Identifier: Apache-2.0
"""The program that renders: started by host.py in the wheel host's Python, it takes one JSON command a line and answers
each.

Holds named viewers, each a stage and a live UsdImagingGL.Engine with the OocPT delegate and no GPU of the host
(`gpuEnabled=False`). Commands are the methods of `Commands`; answers are {"result": …, "log": …} or {"error": …, "log":
…}, where log is everything that was written to standard error, by anyone in the process, while the command ran. Arrays
come back in .npz files. One thread.
"""

from __future__ import annotations

import ctypes
import gc
import json
import os
import sys
import tempfile
import time
import traceback

import numpy as np
from pxr import CameraUtil, Gf, Sdf, Tf, Usd, UsdAppUtils, UsdGeom, UsdImagingGL, UsdLux, Vt

sys.path.append(os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../plugin"))

import aov_reader  # noqa: E402  of the product

RENDERER = "HdOocPTRendererPlugin"


class Viewer:
    """A stage, an engine, and what the next picture is to be."""

    def __init__(
        self, stage: Usd.Stage, size, camera: str, aovs: list[str], settings: dict, purposes: list[str]
    ) -> None:
        # The camera is a path, or a pair of matrices: view and projection.
        self.stage, self.size, self.camera, self.aovs = stage, tuple(size), camera, list(aovs)
        # A CameraUtil.Framing, if the picture is not the whole view.
        self.framing = None
        parameters = UsdImagingGL.Engine.Parameters()
        parameters.gpuEnabled = False
        parameters.rendererPluginId = RENDERER
        self.engine = UsdImagingGL.Engine(parameters)
        if self.engine.GetCurrentRendererId() != RENDERER and not self.engine.SetRendererPlugin(RENDERER):
            raise RuntimeError(f"the host cannot make {RENDERER}; it knows {UsdImagingGL.Engine.GetRendererPlugins()}")
        for key, value in settings.items():
            self.engine.SetRendererSetting(key, value)
        self.params = UsdImagingGL.RenderParams()
        self.params.complexity = 1.0
        self.params.enableLighting = True
        self.params.enableSceneMaterials = True
        self.params.clearColor = Gf.Vec4f(0, 0, 0, 0)
        self.params.showGuides = "guide" in purposes
        self.params.showProxy = "proxy" in purposes
        self.params.showRender = "render" in purposes

    def prepare(self) -> None:
        width, height = self.size
        self.engine.SetRenderBufferSize(Gf.Vec2i(width, height))
        self.engine.SetFraming(self.framing or CameraUtil.Framing(Gf.Rect2i(Gf.Vec2i(0, 0), width, height)))
        if isinstance(self.camera, str):
            self.engine.SetCameraPath(Sdf.Path(self.camera))
        else:
            self.engine.SetCameraState(*self.camera)
        if not aov_reader.set_aovs(self.engine, self.aovs):
            raise RuntimeError(f"the engine refused the AOVs {self.aovs}")

    def step(self) -> bool:
        """One Hydra execution; whether the picture is finished."""
        self.engine.Render(self.stage.GetPseudoRoot(), self.params)
        return self.engine.IsConverged()

    def finish(self, timeout: float) -> float:
        self.prepare()
        start = time.monotonic()
        while not self.step():
            if time.monotonic() - start > timeout:
                raise TimeoutError(f"not converged after {timeout} s; stats {self.stats()}")
            time.sleep(0.002)
        return time.monotonic() - start

    def stats(self) -> dict:
        return {str(key): value for key, value in dict(self.engine.GetRenderStats()).items()}


class Commands:
    """What a test may ask for."""

    def __init__(self, folder: str) -> None:
        self._folder, self._viewers, self._files = folder, {}, 0

    def open(self, viewer, stage, size, camera="/World/Camera", aovs=("color",), settings=None, purposes=("proxy",)):
        """Opens a stage (a path, or the text of a layer) in a new engine."""
        if stage.startswith("#usda"):
            layer = Sdf.Layer.CreateAnonymous(".usda")
            if not layer.ImportFromString(stage):
                raise ValueError("the layer's text does not parse")
            opened = Usd.Stage.Open(layer)
        else:
            opened = Usd.Stage.Open(stage)
        self._viewers[viewer] = Viewer(opened, size, camera, list(aovs), settings or {}, list(purposes))

    def close(self, viewer):
        del self._viewers[viewer]

    def render(self, viewer, timeout=120.0):
        """Renders to convergence; returns where the arrays are, the seconds and the state of each buffer."""
        view = self._viewers[viewer]
        seconds = view.finish(timeout)
        self._files += 1
        path = os.path.join(self._folder, f"{os.getpid()}-{self._files}.npz")
        arrays = {name: aov_reader.read(view.engine, name) for name in view.aovs}
        np.savez(path, **{name: array for name, array in arrays.items() if array is not None})
        return {
            "file": path, "seconds": seconds,
            "buffers": {name: aov_reader.buffer_state(view.engine, name) for name in view.aovs},
        }

    def edit(self, viewer, code):
        """Runs Python statements with `stage`, `engine`, `view` and the pxr modules in scope; returns what they leave
        in `result`."""
        view = self._viewers[viewer]
        scope = {"stage": view.stage, "engine": view.engine, "view": view, "result": None, "time": time}
        scope.update(
            CameraUtil=CameraUtil, Gf=Gf, Sdf=Sdf, Tf=Tf, Usd=Usd, UsdGeom=UsdGeom, UsdImagingGL=UsdImagingGL,
            UsdLux=UsdLux, Vt=Vt, aov_reader=aov_reader,
        )
        exec(compile(code, "<edit>", "exec"), scope)  # noqa: S102  the tests' own code
        return scope["result"]

    def live(self, viewer, steps, period=None, patience=60.0):
        """What a host with a window shows while `steps`, statements as those of `edit`, run one after the other: each
        until a picture of what it made is there, or, with a `period`, for so many seconds. Reads every picture that is
        shown.

        For each step: of how many other jobs pictures were shown (`changed`), the largest share of black pixels in any
        (`black`), the least `sampleCount`, which is 0 where nothing is known of a pixel; and meshes built and commits
        made so far, also of those that held the host's thread.
        """
        view = self._viewers[viewer]
        shown, rows = view.stats()["oocpt:shownJob"], []
        for code in steps:
            self.edit(viewer, code)
            begun, row = time.monotonic(), {"changed": 0, "black": 0.0, "sampleCount": np.inf}
            view.step()
            while _is_due(view.stats()) if period is None else time.monotonic() - begun < period:
                if time.monotonic() - begun > patience:
                    raise TimeoutError(f"no other picture in {patience} s after `{code}`; stats {view.stats()}")
                view.step()
                pixels = aov_reader.read(view.engine, "color")
                row["black"] = max(row["black"], float((pixels[..., :3].max(axis=-1) <= 0).mean()))
                counts = aov_reader.read(view.engine, "sampleCount")
                row["sampleCount"] = min(row["sampleCount"], float(counts.min()))
                before, shown = shown, view.stats()["oocpt:shownJob"]
                row["changed"] += int(shown != before)
                time.sleep(0.004)
            stats = view.stats()
            row["meshes"] = stats["oocpt:meshesMade"]
            row["commits"], row["commitsInHostThread"] = stats["oocpt:commits"], stats["oocpt:commitsInHostThread"]
            rows.append(row)
        return rows

    def held(self):
        """What the process holds."""
        return _held()

    def decode(self, viewer, pairs):
        """Hydra's reading of (primId, instanceId) pairs."""
        view = self._viewers[viewer]
        return [aov_reader.decode(view.engine, *pair) for pair in pairs]

    def stats(self, viewer):
        return self._viewers[viewer].stats()

    def record(
        self,
        stage,
        out,
        camera="/World/Camera",
        width=32,
        purposes=("default", "proxy"),
        render_settings=None,
        dome_visible=True,
        camera_light=False,
    ):
        """One frame by UsdAppUtils.FrameRecorder, the core of usdrecord."""
        recorder = UsdAppUtils.FrameRecorder(RENDERER, False)
        recorder.SetImageWidth(width)
        recorder.SetComplexity(1.0)
        recorder.SetColorCorrectionMode("disabled")
        recorder.SetIncludedPurposes(list(purposes))
        recorder.SetCameraLightEnabled(camera_light)
        recorder.SetDomeLightVisibility(dome_visible)
        opened = Usd.Stage.Open(stage)
        if render_settings:
            recorder.SetActiveRenderSettingsPrimPath(Sdf.Path(render_settings))
        if not recorder.Record(opened, UsdGeom.Camera.Get(opened, camera), Usd.TimeCode.EarliestTime(), out):
            raise RuntimeError("Record returned False")

    def cycles(self, stage, count, size=(8, 8), camera="/World/Camera", every=50, planted=0):
        """`count` engines made, rendered once with 1 sample and destroyed; what the process holds after each `every` of
        them.

        `planted` bytes are taken from the allocator in each cycle and never given back.
        """
        opened = Usd.Stage.Open(stage)
        settings = {"oocpt:samplesPerPixel": 1, "oocpt:maxBounces": 0}
        held = []
        for cycle in range(1, count + 1):
            view = Viewer(opened, size, camera, ["color"], settings, [])
            view.finish(60.0)
            if view.stats()["numCompletedSamples"] != 1:
                raise RuntimeError(f"cycle {cycle} rendered nothing: {view.stats()}")
            del view
            if planted:
                _LIBC.malloc(planted)
            if cycle % every == 0:
                # USD forgets the listeners of scene indices that are gone only when the stage has something to tell.
                opened.SetMetadata("comment", f"{cycle}")
                held.append(_held())
        return held


def _is_due(stats: dict) -> bool:
    """Whether a picture is to come: its scene is being committed, or it is not shown yet."""
    return stats["oocpt:commitPending"] or stats["oocpt:shownJob"] < stats["oocpt:job"]


_LIBC = ctypes.CDLL(None)
_LIBC.malloc.restype, _LIBC.malloc.argtypes = ctypes.c_void_p, [ctypes.c_size_t]


def _allocated() -> int:
    """Bytes that the process has of jemalloc; 0 where it is not preloaded."""
    if not hasattr(_LIBC, "mallctl"):
        return 0
    epoch, allocated, size = ctypes.c_uint64(1), ctypes.c_size_t(), ctypes.c_size_t(8)
    # Statistics are those of the last epoch.
    failed = _LIBC.mallctl(b"epoch", None, None, ctypes.byref(epoch), ctypes.c_size_t(8))
    failed |= _LIBC.mallctl(b"stats.allocated", ctypes.byref(allocated), ctypes.byref(size), None, ctypes.c_size_t(0))
    if failed:
        raise RuntimeError(f"jemalloc has no statistics: error {failed}")
    return allocated.value


def _held() -> dict[str, int]:
    """What the process holds: bytes in use by the allocator, resident bytes, mappings, file descriptors and threads.

    Bytes that lie in a thread's cache of the allocator count as used: switch the caches off for exact numbers.
    """
    gc.collect()
    with open("/proc/self/statm", encoding="ascii") as statm:
        resident = int(statm.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    with open("/proc/self/maps", encoding="utf-8", errors="replace") as maps:
        mappings = sum(1 for _ in maps)
    return {
        "allocated": _allocated(),
        "resident": resident,
        "mappings": mappings,
        "files": len(os.listdir("/proc/self/fd")),
        "threads": len(os.listdir("/proc/self/task")),
    }


class StandardError:
    """File descriptor 2 of the process, caught in a file; C++ and threads included."""

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile(mode="w+b")
        os.dup2(self._file.fileno(), 2)

    def take(self) -> str:
        sys.stderr.flush()
        self._file.seek(0)
        text = self._file.read().decode(errors="replace")
        self._file.seek(0)
        self._file.truncate()
        return text


def know_connectable_types() -> None:
    """Asks for what UsdShade registers at the first question about a type. Where two threads of UsdImaging ask first at
    the same time, 25.08 registers a type twice and calls that an error."""
    from pxr import Usd, UsdShade

    stage = Usd.Stage.CreateInMemory()
    lights = ["Sphere", "Rect", "Disk", "Cylinder", "Distant", "Dome"]
    for name in [*(f"{light}Light" for light in lights), "DomeLight_1", "Material", "NodeGraph", "Shader"]:
        UsdShade.ConnectableAPI(stage.DefinePrim(f"/{name}", name)).IsContainer()


def main() -> None:
    # Answers go to a private copy of standard output: what others print there must not mix with them.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    errors = StandardError()
    os.dup2(2, 1)
    know_connectable_types()
    commands = Commands(sys.argv[1])
    for line in sys.stdin:
        request = json.loads(line)
        answer = {}
        try:
            answer["result"] = getattr(commands, request.pop("command"))(**request)
        except BaseException as error:  # noqa: BLE001  a Tf error must come back as an answer
            answer["error"] = f"{type(error).__name__}: {error}"
            answer["trace"] = traceback.format_exc()
        answer["log"] = errors.take()
        answers.write(json.dumps(answer, default=str) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
