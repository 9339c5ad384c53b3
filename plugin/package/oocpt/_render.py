# SPDX-License-Identifier: Apache-2.0
"""The package's functions: they start the process that renders, wait for it, and read what it left."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import IO, Any, Protocol, TypeAlias, runtime_checkable

import numpy as np

from oocpt._host import RenderError, command, environment
from oocpt._picture import Picture


@runtime_checkable
class Stage(Protocol):
    """`Usd.Stage` of any OpenUSD, none of which this package imports."""

    def Flatten(self, addSourceFileComment: bool = ...) -> Any: ...  # noqa: N802, N803  names of OpenUSD


Scene: TypeAlias = str | os.PathLike[str] | Stage
_MAX_SIDE = 65_535
_NO_DRIVER = "no usable Vulkan device"
# Of what a process said, for an error's text.
_LINES = 8


def render(
    scene: Scene,
    *,
    camera: str | None = None,
    width: int = 960,
    height: int | None = None,
    samples: int | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    aovs: Sequence[str] = ("color",),
    settings: Mapping[str, object] | None = None,
    purposes: Sequence[str] = ("proxy",),
    time: float | None = None,
    camera_light: bool = False,
    progress: bool | Callable[[float], object] | None = None,
) -> Picture:
    """Renders one frame of a USD scene to arrays.

    All images have the shape (height, width) or (height, width, components). **Row 0 is the top of the picture**,
    column 0 its left. Domes are seen in the background. Without lights in the scene the picture is black, unless
    `camera_light` puts one at the camera.

    Args:
        scene: a file, or a `Usd.Stage` of any OpenUSD, which is flattened to a file: the renderer has a process of its
            own. Edits of the stage and its session layer are part of it.
        camera: path of a camera, or the last element of its path. Without it: that of the stage's render settings, else
            the one named `main_cam`, else the only one, else one is made that sees the whole scene.
        width: of the picture in pixels.
        height: in pixels; without it from the camera's aperture.
        samples: of each pixel; without it the scene's `oocpt:samplesPerPixel`, else 64.
        checkpoint: a file in which the samples are kept, and with which the render goes on if it is there and of the
            same picture.
        aovs: which images. `color`: f32, RGBA, linear Rec. 709 radiance premultiplied by alpha. `depth`: f32, clip
            space, 0 at the near plane, 1 at the far one and where nothing is. `cameraDepth`: f32, along the view axis,
            in units of the scene, 0 where nothing is. `normal`, `Neye`: f32, 3, shading normal in the space of the
            world and of the camera. `albedo`: f32, 3. `motion`: f32, 3, pixels to the right, pixels up, change of
            cameraDepth. `primId`, `instanceId`, `elementId`, `materialId`: i32, -1 where nothing is. `sampleCount`:
            f32. `position`, `Peye`: f32, 3, the point in the space of the world and of the camera. `Ng`: f32, 3, normal
            of the surface as it is traced. `variance`: f32, 3, of the samples. `error`: f32, estimated standard error
            relative to the pixel. `lpe:C<RD>L` and others: f32, 3, light by its paths. `motionBoth`: f32, 4, pixels to
            the right and up to the shutter's middle, then from it. `shadow`: f32, 4, the share of the light that does
            not arrive, by channel and of the luminance. `shadowCatcher`: f32, alpha of shadow catchers. `loadWaits`:
            f32, how often a sample waited for loads. `primvars:st` and others: f32, 4.
        settings: settings of the renderer by key, "oocpt:" may be left out; they stand above those of the scene.
        purposes: drawn in addition to `default`: `render`, `proxy`, `guide`. The default is usdrecord's.
        time: a time code; without it the stage's first one.
        camera_light: whether there is usdrecord's light at the camera.
        progress: called with the fraction that is done, some times a second; True draws a bar on standard error.

    Returns:
        The images by name, with the renderer's `messages` and `statistics`.

    Raises:
        RenderError: the scene does not open, a setting or an image is not known, there is no device, or the renderer
            failed; the text says what it said.
        ValueError: an argument cannot be right for any scene.
    """
    _check_size(width)
    if height is not None:
        _check_size(height)
    names = list(dict.fromkeys(aovs))
    if isinstance(aovs, str) or not names:
        raise ValueError("aovs is a sequence of names, for example ('color', 'depth')")
    chosen = dict(settings or {})
    if samples is not None:
        chosen["samplesPerPixel"] = samples
    if checkpoint is not None:
        chosen["checkpoint"] = os.path.abspath(os.fspath(checkpoint))
        chosen.setdefault("enableInteractive", False)  # a live view keeps no samples in files
    with tempfile.TemporaryDirectory(prefix="oocpt-") as folder:
        request = {
            "scene": _file_of(scene, folder),
            "camera": camera,
            "width": int(width),
            "height": None if height is None else int(height),
            "purposes": list(purposes),
            "aovs": names,
            "time": time,
            "camera_light": bool(camera_light),
            "settings": {str(key): _text(value) for key, value in chosen.items()},
        }
        Path(folder, "request.json").write_text(json.dumps(request), encoding="utf-8")
        messages = _run_render(folder, progress)
        statistics = json.loads(Path(folder, "statistics.json").read_text(encoding="utf-8"))
        images = {name: np.load(Path(folder, f"{at}.npy"), allow_pickle=False) for at, name in enumerate(names)}
    return Picture(images, messages, statistics)


def usdrecord(arguments: Iterable[str | os.PathLike[str]]) -> list[str]:
    """Runs `usdrecord` with the plugin: `oocpt.usdrecord(["--samples", "64", "scene.usda", "picture.exr"])`. Flags are
    those of `oocpt record --help`. The light at the camera is on, as in Pixar's usdrecord; `--disableCameraLight` turns
    it off.

    Returns:
        What it said on standard error, one line each.

    Raises:
        RenderError: its exit status is not 0; the text is what it said.
    """
    done = subprocess.run(
        command("usdrecord", arguments), env=environment(), stdin=subprocess.DEVNULL, capture_output=True, text=True,
        errors="replace", check=False,
    )  # fmt: skip
    lines = [line for line in done.stderr.splitlines() if line.strip()]
    if done.returncode != 0:
        raise RenderError(_told(lines, done.returncode))
    return lines


def _check_size(pixels: int) -> None:
    if not 1 <= int(pixels) <= _MAX_SIDE:
        raise ValueError(f"a side of {pixels} pixels; from 1 to {_MAX_SIDE} are possible")


def _text(value: object) -> str:
    """A setting's value as settings are written in the environment."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _file_of(scene: Scene, folder: str) -> str:
    if isinstance(scene, Stage):
        path = os.path.join(folder, "stage.usdc")
        if not scene.Flatten(addSourceFileComment=False).Export(path):
            raise RenderError("the stage cannot be written to a file for the renderer")
        return path
    path = os.path.abspath(os.fspath(scene))
    if not os.path.exists(path):
        raise RenderError(f"no file {path}")
    return path


def _run_render(folder: str, progress: bool | Callable[[float], object] | None) -> list[str]:
    """Waits for the process that renders; what it said. It is ended when this thread is interrupted."""
    tell = _draw if progress is True else progress or (lambda _: None)
    reading, writing = os.pipe()
    with open(os.path.join(folder, "messages"), "w+b") as messages, open(reading, encoding="ascii") as fractions:
        process = subprocess.Popen(
            command("render", [folder, str(writing)]), env=environment(), stdin=subprocess.DEVNULL, stdout=messages,
            stderr=messages, pass_fds=[writing], start_new_session=True,
        )  # fmt: skip
        try:
            os.close(writing)
            for line in fractions:  # ends when the process does
                tell(float(line))
            status = process.wait()
        finally:
            process.kill()
            process.wait()
        lines = _lines_of(messages)
    if status != 0:
        raise RenderError(_told(lines, status))
    return lines


def _draw(fraction: float) -> None:
    bar = "#" * round(40 * fraction)
    print(f"\r[{bar:.<40}] {fraction:4.0%}", end="\n" if fraction >= 1.0 else "", file=sys.stderr, flush=True)


def _lines_of(file: IO[bytes]) -> list[str]:
    file.seek(0)
    text = file.read().decode(errors="replace")
    return [line for line in text.splitlines() if line.strip()]


def _told(lines: list[str], status: int) -> str:
    text = "\n".join(lines[-_LINES:]) or f"the process that renders ended with status {status} and said nothing"
    if _NO_DRIVER in text:
        text += "\n" + driver_hint()
    return text


def driver_hint() -> str:
    """How a machine gets a Vulkan driver."""
    text = "A GPU's driver has one; for the processor: apt-get install mesa-vulkan-drivers"
    try:
        release = Path("/etc/os-release").read_text(encoding="utf-8")
    except OSError:
        release = ""
    if "VERSION_CODENAME=bookworm" in release:
        text += " from bookworm-backports (Debian 12's own, Mesa 22, computes wrong pictures and is refused)"
    return text


if sys.platform != "linux":
    raise ImportError("oocpt runs on Linux only")
