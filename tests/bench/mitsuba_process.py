# SPDX-License-Identifier: Apache-2.0
"""Run by a Python that has mitsuba and numpy: loads what mitsuba_scene.py wrote and renders it.

Arguments: a JSON file with what to do. A line of JSON on standard output for the load and for each render. The variant
is that of the job, else `cuda_ad_rgb` where there is an NVIDIA GPU and `scalar_rgb` elsewhere. `llvm_ad_rgb` needs LLVM
17 or later, and compiles for minutes where a scene has dozens of materials.
"""

from __future__ import annotations

import glob
import json
import os
import pathlib
import re
import resource
import subprocess
import sys
import time

MIN_LLVM = 17
AT_ONCE = 1 << 24
"""Samples of a launch."""


def tell(**said) -> None:
    print("RESULT " + json.dumps(said), flush=True)


def llvm(listed: str) -> str | None:
    """The newest usable libLLVM in what `ldconfig -p` lists; older ones end the process."""
    found = re.findall(r"libLLVM(?:-|\.so\.)(\d+)\S* .*=> (\S+)", listed)
    usable = [(int(version), path) for version, path in found if int(version) >= MIN_LLVM]
    return max(usable)[1] if usable else None


def variant(asked: str) -> str:
    """The variant to render with; leads Mitsuba to its LLVM."""
    if "DRJIT_LIBLLVM_PATH" not in os.environ:
        program = "/sbin/ldconfig" if os.path.exists("/sbin/ldconfig") else "ldconfig"
        listed = subprocess.run([program, "-p"], capture_output=True, text=True, check=False).stdout
        if found := llvm(listed):
            os.environ["DRJIT_LIBLLVM_PATH"] = found
    return asked or ("cuda_ad_rgb" if glob.glob("/dev/nvidia[0-9]*") else "scalar_rgb")


def linear(pixels, bits: int, space: str):
    """`sourceColorSpace`: auto is sRGB for pictures of 8 bits and three or four channels."""
    import numpy as np

    if space == "sRGB" or (space == "auto" and bits == 8 and pixels.shape[2] >= 3):
        colors = 1 if pixels.shape[2] < 3 else 3
        low = pixels[..., :colors]
        pixels[..., :colors] = np.where(low <= 0.04045, low / 12.92, ((low + 0.055) / 1.055) ** 2.4)
    return pixels


def decoded(mi, path: str, space: str):
    """(height, width, 4), linear, row 0 at the bottom."""
    import numpy as np

    pixels = np.array(mi.Bitmap(path))
    pixels = pixels[..., None] if pixels.ndim == 2 else pixels
    bits = 8 * pixels.dtype.itemsize
    top = np.iinfo(pixels.dtype).max if pixels.dtype.kind == "u" else 1
    pixels = linear(pixels.astype(np.float32) / np.float32(top), bits, space)
    ones = np.ones_like(pixels[..., :1])
    if pixels.shape[2] < 3:
        pixels = np.concatenate([pixels[..., :1]] * 3 + [pixels[..., 1:2] if pixels.shape[2] == 2 else ones], 2)
    elif pixels.shape[2] == 3:
        pixels = np.concatenate([pixels, ones], 2)
    return pixels[::-1]


def pixels_of(mi, own: dict):
    """The values of a picture (see mitsuba_materials.picture): tiles put together, channels, scale, bias, threshold."""
    import numpy as np

    pick = ["rgba".index(channel) for channel in own["channels"]]
    loaded = [(decoded(mi, path, own["space"])[..., pick], column, row) for path, column, row in own["files"]]
    height, width = loaded[0][0].shape[:2]
    across, rows = max(column for _, column, _ in loaded) + 1, max(row for _, _, row in loaded) + 1
    made = np.zeros((rows * height, across * width, len(pick)), np.float32)
    for tile, column, row in loaded:
        y, x = (np.arange(size) * of // size for size, of in zip((height, width), tile.shape))
        made[row * height : (row + 1) * height, column * width : (column + 1) * width] = tile[y][:, x]
    made = made * np.array(own["scale"], np.float32) + np.array(own["bias"], np.float32)
    if "threshold" in own:
        made = (doubled(doubled(made[..., 0])) >= own["threshold"]).astype(np.float32)[..., None]
    return made


def doubled(grey):
    """Bilinear, twice the resolution, edges repeated: so that a cut follows the filtered picture."""
    import numpy as np

    for axis in (0, 1):
        last = grey.shape[axis] - 1
        before = np.concatenate([grey.take([0], axis), grey.take(range(last), axis)], axis)
        after = np.concatenate([grey.take(range(1, last + 1), axis), grey.take([last], axis)], axis)
        both = np.stack([0.75 * grey + 0.25 * before, 0.75 * grey + 0.25 * after], axis + 1)
        grey = both.reshape(2 * grey.shape[0], -1) if axis == 0 else both.reshape(grey.shape[0], -1)
    return grey


def rows_on_edges(pixels):
    """From rows at (j + 1/2) / n of the height to those of Mitsuba's `envmap` at j / (n - 1)."""
    import numpy as np

    count = pixels.shape[0]
    positions = np.arange(2 * count + 1) / 2 - 0.5
    low = np.floor(positions).astype(int)
    weight = (positions - low)[:, None, None].astype(np.float32)
    at = lambda k: pixels[np.clip(k, 0, count - 1)]
    return at(low) * (1 - weight) + at(low + 1) * weight


class Made:
    """Mitsuba's objects of what mitsuba_scene.py wrote."""

    def __init__(self, mi, folder: pathlib.Path) -> None:
        self._mi, self._folder, self._bitmaps = mi, folder, {}
        self.prepared = 0.0
        """Seconds of Python's own work on pictures and displaced meshes; a scene of Mitsuba's own needs none."""

    def entry(self, given):
        """A value of the dictionary."""
        if isinstance(given, list):
            return [self.entry(value) for value in given]
        if not isinstance(given, dict):
            return given
        if "matrix" in given:
            kind = self._mi.ScalarTransform4f if len(given["matrix"]) == 4 else self._mi.ScalarTransform3f
            return kind(given["matrix"])
        plain = ("picture", "points", "raised", "by")
        made = {key: self.entry(value) for key, value in given.items() if key not in plain}
        if "picture" in given:
            return self._bitmap(given, made)
        if "points" in given:
            made |= self._balls(given["points"])
        if "raised" in given:
            self._raise(given)
        if "filename" in made:
            made["filename"] = str(self._folder / made["filename"])
        return made

    def _bitmap(self, given: dict, made: dict):
        key = json.dumps(given, sort_keys=True)
        if key not in self._bitmaps:
            start = time.monotonic()
            pixels = pixels_of(self._mi, given["picture"])
            self.prepared += time.monotonic() - start
            if given["type"] == "envmap":
                made["bitmap"] = self._mi.Bitmap(rows_on_edges(pixels[::-1]))
            else:
                made["bitmap"] = self._mi.Bitmap(pixels if pixels.shape[2] > 1 else pixels[..., 0].copy())
            self._bitmaps[key] = self._mi.load_dict(made)
        return self._bitmaps[key]

    def _raise(self, given: dict) -> None:
        """Writes the file of a displaced mesh."""
        import numpy as np

        from mitsuba_meshes import Mesh

        start = time.monotonic()
        with np.load(self._folder / given["raised"]) as arrays:
            mesh = Mesh(*(arrays[name] for name in ("points", "normals", "st", "faces")))
        heights = pixels_of(self._mi, given["by"]["picture"])[..., 0]
        to_uv = np.array(given["by"]["to_uv"]["matrix"])
        mesh.raised(heights, to_uv).write(self._folder / given["filename"])
        self.prepared += time.monotonic() - start

    def _balls(self, file: str) -> dict:
        import numpy as np

        points = np.load(self._folder / file)
        turns = np.zeros((len(points), 4), np.float32)
        turns[:, 3] = 1
        tensor = self._mi.TensorXf
        scales = np.ascontiguousarray(np.repeat(points[:, 3:], 3, 1))
        centers = tensor(np.ascontiguousarray(points[:, :3]))
        return {"centers": centers, "scales": tensor(scales), "quaternions": tensor(turns)}

    def scene(self):
        import numpy as np

        made: dict = {}
        for name, given in json.loads((self._folder / "scene.json").read_text()).items():
            if isinstance(given, dict) and "places" in given:
                for number, place in enumerate(np.load(self._folder / given["places"])):
                    made[f"{name}{number}"] = {
                        "type": "instance", "group": {"type": "ref", "id": given["group"]},
                        "to_world": self._mi.ScalarTransform4f(place),
                    }  # fmt: skip
            else:
                made[name] = self.entry(given)
        # What is referred to comes first.
        order = lambda name: (0 if name.startswith("material") else 1 if isinstance(made[name], dict) and
            made[name].get("type") == "shapegroup" else 2)  # fmt: skip
        return self._mi.load_dict({name: made[name] for name in sorted(made, key=order)})


def render(mi, scene, samples: int, seed: int):
    """(height, width, 3), of as many launches as it needs, and the samples it has: the sampler rounds up."""
    import numpy as np

    width, height = scene.sensors()[0].film().crop_size()
    piece = max(1, min(samples, AT_ONCE // (width * height)))
    total, done = np.zeros((height, width, 3)), 0
    while done < samples:
        picture = mi.render(scene, spp=min(piece, samples - done), seed=seed * 100003 + done)
        count = scene.sensors()[0].sampler().sample_count()
        total += count * np.array(picture, np.float64)[..., :3]
        done += count
    return total / done, done


def main() -> None:
    job = json.loads(pathlib.Path(sys.argv[1]).read_text())
    asked = variant(job.get("variant", ""))
    sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
    import exr_pixels
    import mitsuba as mi

    mi.set_variant(asked)
    mi.set_log_level(mi.LogLevel.Error)
    out = pathlib.Path(job["out"])
    start = time.monotonic()
    made = Made(mi, out)
    scene = made.scene()
    seconds = time.monotonic() - start - made.prepared
    tell(kind="load", seconds=seconds, prepared=made.prepared, version=mi.__version__, variant=mi.variant())
    start = time.monotonic()
    render(mi, scene, 1, 77)
    tell(kind="compile", seconds=time.monotonic() - start)
    known = set()
    for samples, seed in job["renders"]:
        # A reference is its own warm-up; what is timed has its kernels.
        if samples not in known and seed != job["reference_seed"]:
            render(mi, scene, samples, 77)
            known.add(samples)
        before = sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
        start = time.monotonic()
        picture, taken = render(mi, scene, samples, seed)
        seconds = time.monotonic() - start
        used = sum(resource.getrusage(resource.RUSAGE_SELF)[:2]) - before
        exr_pixels.write(out / f"mitsuba-{samples}-{seed}.exr", picture)
        tell(kind="render", samples=samples, taken=taken, seed=seed, seconds=seconds, cpu=used)


if __name__ == "__main__":
    main()
