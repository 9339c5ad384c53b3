#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Paths a second and memory of hairs, balls and meshes, ours and Mitsuba's, on this machine.

    curves.py --oocpt PROGRAM [--subjects hair,points,limit,polygons] [--counts hair=1000000,points=10000000,...]
        [--width 1280] [--height 720] [--samples 64] [--bounces 5] [--runs 3] [--only ours|mitsuba] [--pictures FOLDER]
        [--json OUT.json]

The scenes are those of `oocpt bench curves`, which renders our side; Mitsuba's are made here from the same formulas
(`rust/scenes/src/fur.rs`): the same hairs as `bsplinecurve` (round, five control points and two phantom ones, four
pieces), the same balls as `ellipsoids`, the same triangles with flat normals; diffuse, below a constant dome. `limit`
is a subdivision surface for us, cut to `--dicing-rate`; Mitsuba gets a mesh of that surface with about as many
triangles as ours came to.

- Same picture, samples and bounces. A path is a sample of a pixel: a ray of the camera, at every vertex a ray to the
  light and one on. Mitsuba's roulette begins where ours does (rr_depth 4); its last vertices trace one ray more. Hairs
  are pieces of cones near the curve for us, with caps; Mitsuba meets the curve itself, without caps.
- Seconds are medians of `--runs` renders after one of the same shape; building, loading and compiling are printed
  apart.
- `memory` is the most that the device had in use while the side ran, less what it had before, in MiB, as `nvidia-smi`
  says it: contexts, code and launch buffers too. `loaded` is that after a render of one sample.

Each side runs in a process of its own. Run by `cargo xtask reference curves ...`.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import contextlib
import json
import math
import multiprocessing
import pathlib
import shutil
import statistics
import subprocess
import sys
import tempfile
import threading
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import numpy as np  # noqa: E402

COUNTS = {"hair": 10_000, "points": 10_000, "limit": 10_000, "polygons": 10_000}
GOLDEN = 0x9E3779B97F4A7C15
ROULETTE = 4
"""Mitsuba counts vertices from 1, our bounces from 0."""
BALLS_SCALE = 100.0
"""The scene of the balls is so much larger in Mitsuba, camera and all: at radii of 0.006 its `ellipsoids` block only
a part of the rays that its `sphere` blocks."""


def _mixed(z: np.ndarray) -> np.ndarray:
    """The finaliser of SplitMix64 (Steele, Lea, Flood 2014)."""
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


def units(key: int, count: int) -> np.ndarray:
    """The first numbers in [0, 1) of the stream of one key."""
    golden = np.array([GOLDEN], np.uint64)
    state = _mixed(golden ^ _mixed(np.array([key], np.uint64) + golden))
    return (_mixed(state + np.arange(1, count + 1, dtype=np.uint64) * golden) >> np.uint64(11)) / 2.0**53


def _directions(drawn: np.ndarray) -> np.ndarray:
    """Of pairs of numbers."""
    y, angle = 2 * drawn[:, 0] - 1, drawn[:, 1] * math.tau
    radius = np.sqrt(1 - y * y)
    return np.stack([radius * np.cos(angle), y, radius * np.sin(angle)], axis=1)


def hairs(count: int) -> tuple[np.ndarray, float]:
    """(count, 5, 3) control points in f32, and the width."""
    drawn = units(11, 4 * count).reshape(count, 4)
    root, bend = _directions(drawn[:, :2]), 0.02 * _directions(drawn[:, 2:])
    k = np.arange(5)
    along = 0.8 + 0.06 * k
    points = root[:, None] * along[:, None] + bend[:, None] * (0.4 * k * k)[:, None]
    return points.astype(np.float32), 0.6 / math.sqrt(count)


def pinned(points: np.ndarray) -> np.ndarray:
    """With the phantom points of `wrap = "pinned"`: the ends are where the outer control points are."""
    first, last = 2 * points[:, :1] - points[:, 1:2], 2 * points[:, -1:] - points[:, -2:-1]
    return np.concatenate([first, points, last], axis=1)


def balls(count: int) -> tuple[np.ndarray, float]:
    """(count, 3) centres in f32, and the width."""
    return (2 * units(12, 3 * count) - 1).reshape(count, 3).astype(np.float32), 1 / count ** (1 / 3)


def creature(quads: int) -> tuple[np.ndarray, np.ndarray]:
    """Points in f32 and triangles, two a quad."""
    side = math.isqrt(quads)
    v, u = np.meshgrid(np.arange(side + 1) / side, np.arange(side + 1) / side, indexing="ij")
    a, b = u * math.tau, (v - 0.5) * math.pi
    radius = 1 + 0.08 * np.sin(9 * a) * np.cos(7 * b)
    points = np.stack([np.cos(a) * np.cos(b), np.sin(b), np.sin(a) * np.cos(b)], axis=-1) * radius[..., None]
    corner = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel().astype(np.uint32)
    below = corner + np.uint32(side + 1)
    faces = np.stack([corner, below, corner + 1, corner + 1, below, below + 1], axis=1).reshape(-1, 3)
    return points.reshape(-1, 3).astype(np.float32), faces


class DeviceMemory:
    """MiB in use on the first NVIDIA device, read about every 50 ms; None without `nvidia-smi`."""

    QUERY = ("nvidia-smi", "--query-gpu=memory.used", "--format=csv,noheader,nounits", "--id=0")

    def __init__(self) -> None:
        self.now: int | None = None
        self.most: int | None = None
        self._process = None
        if shutil.which(self.QUERY[0]):
            self._process = subprocess.Popen([*self.QUERY, "--loop-ms=50"], stdout=subprocess.PIPE, text=True)
            threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        for line in self._process.stdout:
            with contextlib.suppress(ValueError):
                self.now = int(line)
                self.most = max(self.most or 0, self.now)

    def settled(self) -> int | None:
        """What is in use once a few readings have come in; the most begins anew."""
        if self._process is None:
            return None
        time.sleep(0.6)
        self.most = self.now
        return self.now

    def close(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()


def _scene(subject: str, count: int, arguments):
    """Mitsuba's scene."""
    import mitsuba as mi
    import to_mitsuba  # noqa: F401  (sets the variant)

    diffuse = lambda value: {"type": "diffuse", "reflectance": {"type": "rgb", "value": value}}
    scale = 1.0
    if subject == "hair":
        points, width = hairs(count)
        points = pinned(points)
        made = points.shape[1]
        flat = np.full((count * made, 4), width / 2, np.float32)
        flat[:, :3] = points.reshape(-1, 3)
        pieces = np.arange(count, dtype=np.uint32)[:, None] * made + np.arange(made - 3, dtype=np.uint32)
        with tempfile.NamedTemporaryFile("w", suffix=".txt") as file:
            # It is only made of files; arrays take the place of what was in it.
            file.write("0 0 0 1\n1 0 0 1\n2 0 0 1\n3 0 0 1\n")
            file.flush()
            shape = mi.load_dict({"type": "bsplinecurve", "filename": file.name, "bsdf": diffuse(0.18)})
        parameters = mi.traverse(shape)
        parameters["control_point_count"] = len(flat)
        parameters["control_points"] = mi.Float(flat.ravel())
        parameters["segment_indices"] = mi.UInt32(pieces.ravel())
        parameters.update()
    elif subject == "points":
        scale = BALLS_SCALE
        centers, width = balls(count)
        centers, width = centers * np.float32(scale), width * scale
        turns = np.zeros((count, 4), np.float32)
        turns[:, 3] = 1
        shape = mi.load_dict({
            "type": "ellipsoids", "centers": mi.TensorXf(centers), "quaternions": mi.TensorXf(turns), "extent": 1.0,
            "scales": mi.TensorXf(np.full((count, 3), width / 2, np.float32)), "bsdf": diffuse(0.18),
        })  # fmt: skip
    else:
        points, faces = creature(count)
        properties = mi.Properties()
        properties["bsdf"] = mi.load_dict({"type": "twosided", "bsdf": diffuse(0.5)})
        properties["face_normals"] = True
        shape = mi.Mesh("creature", len(points), len(faces), props=properties)
        parameters = mi.traverse(shape)
        parameters["vertex_positions"] = mi.Float(points.ravel())
        parameters["faces"] = mi.UInt32(faces.ravel())
        parameters.update()
    sensor = {
        "type": "perspective", "fov": math.degrees(0.6), "fov_axis": "y", "near_clip": 0.1 * scale,
        "far_clip": 1000.0 * scale,
        "to_world": mi.ScalarTransform4f().look_at(
            origin=[0, 0.6 * scale, 3.6 * scale], target=[0, 0, 0], up=[0, 1, 0]
        ),
        "film": {"type": "hdrfilm", "width": arguments.width, "height": arguments.height, "rfilter": {"type": "box"},
            "pixel_format": "rgb", "component_format": "float32"},
        "sampler": {"type": "multijitter", "sample_count": arguments.samples},
    }  # fmt: skip
    integrator = {"type": "path", "max_depth": arguments.bounces + 2, "rr_depth": ROULETTE}
    dome = {"type": "constant", "radiance": {"type": "rgb", "value": 1.0}}
    return mi.load_dict({"type": "scene", "integrator": integrator, "sensor": sensor, "dome": dome, "shape": shape})


def mitsuba(subject: str, count: int, arguments) -> dict:
    """Mitsuba's side, in this process."""
    import mitsuba as mi
    import to_mitsuba

    memory = DeviceMemory()
    before = memory.settled()
    start = time.monotonic()
    scene = _scene(subject, count, arguments)
    to_mitsuba.render(scene, 1)
    setup = time.monotonic() - start
    loaded = memory.settled()
    to_mitsuba.render(scene, arguments.samples, 77)
    seconds = []
    for seed in range(arguments.runs):
        start = time.monotonic()
        picture = to_mitsuba.render(scene, arguments.samples, seed)
        seconds.append(time.monotonic() - start)
    most = memory.most
    memory.close()
    if arguments.pictures:
        mi.Bitmap(to_mitsuba.tone(picture)).write(str(arguments.pictures / f"{subject}-mitsuba.png"))
    if not np.isfinite(picture).all():
        raise SystemExit(f"{subject}: not finite")
    return {
        "name": f"Mitsuba {mi.__version__} {mi.variant()}", "count": count, "setup": setup, "seconds": seconds,
        "mean": float(np.clip(picture, 0, 1).mean()), **_memory(before, loaded, most),
    }  # fmt: skip


def _memory(before: int | None, loaded: int | None, most: int | None) -> dict:
    return {} if before is None else {"loaded": loaded and loaded - before, "memory": most - before}


def linear(encoded: np.ndarray) -> np.ndarray:
    """8-bit sRGB as light."""
    x = encoded / 255
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


def ours(subject: str, count: int, arguments) -> dict:
    """Our side: `oocpt bench curves`."""
    memory = DeviceMemory()
    before = memory.settled()
    with tempfile.TemporaryDirectory() as folder:
        command = [
            str(arguments.oocpt), "bench", "curves", "--subjects", subject, "--count", str(count), "--dicing-rate",
            str(arguments.dicing_rate), "--json", f"{folder}/r.json", "--pictures", folder,
        ]  # fmt: skip
        for name in ("width", "height", "samples", "bounces", "runs"):
            command += [f"--{name}", str(getattr(arguments, name))]
        start = time.monotonic()
        said = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        if said.returncode != 0:
            raise SystemExit(f"{' '.join(command)}: {said.stdout[-2000:]}")
        whole = time.monotonic() - start
        report = json.loads(pathlib.Path(folder, "r.json").read_text())
        [drawn] = pathlib.Path(folder).glob("*.png")
        made = _ours_of(report, linear(_pixels(drawn)), whole)
        if arguments.pictures:
            shutil.copy(drawn, arguments.pictures / f"{subject}-ours.png")
    made |= _memory(before, None, memory.most)
    memory.close()
    return made


def _pixels(path: pathlib.Path) -> np.ndarray:
    import to_mitsuba

    return np.array(to_mitsuba.mi.Bitmap(str(path)), dtype=np.float64)[..., :3]


def _ours_of(report: dict, picture: np.ndarray, whole: float) -> dict:
    [row] = report["rows"]
    return {
        "name": f"OocPT {report['machine']['version']}, {report['machine']['device']}", "count": report["count"],
        "items": row["items"], "setup": whole, "seconds": row["trace_secs"], "mean": float(picture.mean()),
        "rays": row["rays"], "scene_bytes": row["scene_bytes"],
    }  # fmt: skip


def rates(made: dict, paths: int) -> dict:
    """With medians and millions a second."""
    seconds = statistics.median(made["seconds"])
    made |= {"median": seconds, "mpaths_per_sec": paths / seconds * 1e-6}
    if "rays" in made:
        made |= {"mrays_per_sec": made["rays"] / seconds * 1e-6, "rays_per_path": made["rays"] / paths}
    return made


def refined_count(triangles: int) -> int:
    """Quads of a mesh with as many triangles, on a square grid."""
    return round(math.sqrt(triangles / 2)) ** 2


def compare(subject: str, count: int, arguments) -> dict:
    """Both sides of one subject, each in a new process."""
    made, paths = {}, arguments.width * arguments.height * arguments.samples
    spawn = multiprocessing.get_context("spawn")
    for key, side in (("ours", ours), ("mitsuba", mitsuba)):
        if arguments.only not in (None, key):
            continue
        theirs = count
        if key == "mitsuba" and subject == "limit":
            theirs = refined_count(made["ours"]["items"]) if "ours" in made else count
        with concurrent.futures.ProcessPoolExecutor(1, spawn) as pool:
            made[key] = rates(pool.submit(side, subject, theirs, arguments).result(), paths)
        print(f"  {subject}: {json.dumps(made[key])}", file=sys.stderr)
    return {"subject": subject, **made}


def line(result: dict) -> str:
    """A result's row of the table."""
    sides = [result.get(key, {}) for key in ("ours", "mitsuba")]
    a, b = sides
    cells = [f"{side['mpaths_per_sec']:.4g}" if side else "-" for side in sides]
    cells.append(f"{a['mpaths_per_sec'] / b['mpaths_per_sec']:.2f}" if a and b else "-")
    cells.append(f"{a['mrays_per_sec']:.4g} ({a['rays_per_path']:.2f})" if a else "-")
    cells += [str(side.get("memory", "-")) for side in sides]
    cells += [f"{side['mean']:.4f}" if side else "-" for side in sides]
    return f"| {result['subject']}, {(a or b)['count']} | " + " | ".join(cells) + " |"


def counts_of(text: str) -> dict[str, int]:
    """`hair=10,points=20`."""
    made = dict(COUNTS)
    for part in filter(None, text.split(",")):
        name, _, number = part.partition("=")
        if name not in made or not number.isdigit() or int(number) < 1:
            raise SystemExit(f"--counts {part}: not NAME=NUMBER with a name of {', '.join(made)}")
        made[name] = int(number)
    return made


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--oocpt", type=pathlib.Path, help="the program whose `bench curves` is our side")
    parser.add_argument("--subjects", default=",".join(COUNTS))
    parser.add_argument("--counts", default="")
    for name, default in (("width", 1280), ("height", 720), ("samples", 64), ("bounces", 5), ("runs", 3)):
        parser.add_argument(f"--{name}", type=int, default=default)
    parser.add_argument("--dicing-rate", type=float, default=2.0)
    parser.add_argument("--only", choices=("ours", "mitsuba"), help="one side only")
    parser.add_argument("--pictures", type=pathlib.Path, help="folder for both pictures of each subject")
    parser.add_argument("--json", type=pathlib.Path)
    arguments = parser.parse_args()
    if arguments.oocpt is None and arguments.only != "mitsuba":
        parser.error("--oocpt is needed for our side")
    counts, results = counts_of(arguments.counts), []
    for subject in arguments.subjects.split(","):
        results.append(compare(subject, counts[subject], arguments))
        # After each subject: what is measured is not lost when the next one takes too long.
        if arguments.json:
            arguments.json.write_text(json.dumps(results, indent=1) + "\n")
    print(f"{arguments.width} x {arguments.height}, {arguments.samples} samples, {arguments.bounces} bounces")
    print(
        "| scene | ours, Mpaths/s | Mitsuba | times as fast | our Mrays/s (rays a path) | our MiB | Mitsuba's |"
        " our mean | Mitsuba's |\n|---|---|---|---|---|---|---|---|---|"
    )
    for result in results:
        print(line(result))


if __name__ == "__main__":
    main()
