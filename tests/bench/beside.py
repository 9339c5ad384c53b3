#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The same USD files by OocPT, Cycles and Mitsuba: seconds until the relMSE of a picture is below a target, each
against a converged picture of its own, and memory. What `cargo xtask bench beside` runs.

    beside.py [--sets reef,city,interior,grove] [--scene FILE[,camera=PATH][,frame=TIME]] [--seed 1] [--size 0.05]
        [--width 160] [--target 5e-2] [--reference 256] [--blender FOLDER] [--mitsuba PYTHON] [--json FILE]

How it is measured:
- relMSE is the mean over pixels and channels of (x - r)^2 / (r^2 + 1e-2); r has `--reference` samples of another seed.
  Models differ, so no picture is compared with another renderer's; how far the converged ones are apart is told, as a
  whole and by region: 3 rows of 4, the means of both.
- Same camera, pixels, box filter and bounces; of Cycles the same shutter too. None clamps, denoises or adapts its
  samples.
- `frame` is what a frame takes when the file has been read: of OocPT the seconds of tracing, of Cycles those of
  Blender's operator, which also makes its scene and trees, of Mitsuba those of its render, whose trees are of the load.
  `whole` is from the file to the picture in a new process: ours as measured, of Cycles the import and the frame, of
  Mitsuba the load of its own files and the frame (starting Blender or Python is not in it; writing Mitsuba's files and
  compiling its kernels are told apart).
- Memory is the most that the process held; what is on a GPU is beside it.
- What Blender's importer did not make is told as counts of both sides. Lamps and suns are given the
  power that OpenUSD defines, which the importer does not; lamps of meshes and what else it leaves out is in how far the
  pictures are apart.

Cycles comes with Blender's Python module: `--blender` is a folder that holds `bpy` (`pip download --no-deps
bpy==5.0.1`, unpacked). With a GPU that it knows it takes OptiX or CUDA, else the processor.

Mitsuba is a package of an environment of its own: `python3 -m venv FOLDER`, then `FOLDER/bin/pip install mitsuba==3.9.1
numpy`; `--mitsuba FOLDER/bin/python` names it. The file is written for it first (mitsuba_scene.py tells how), flattened
to one level of instances; a scene above `--mitsuba-triangles` or `--mitsuba-instances` is refused. Variants:
`cuda_ad_rgb` on a GPU, else `scalar_rgb`; `--mitsuba-variant` names another. What it lacks is told in the JSON as
`left_out`. A renderer that is not there is one line, and the bench goes on.
"""

from __future__ import annotations

import json
import os
import pathlib
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "reference")]

import exr_pixels  # noqa: E402
import measure_sets  # noqa: E402
from time_to_error import relative_mse, time_to  # noqa: E402
from usdrecord_runs import MIB, Host, Scene, record, watched  # noqa: E402

REFERENCE_SEED = 90
SEED = 1


def counts(most: int) -> list[int]:
    """1, 2, 4, ... as far as a reference of `most` samples can judge."""
    return [1 << power for power in range(most.bit_length()) if (4 << power) <= most] or [1]


def until(rows: list[dict], target: float) -> list[dict]:
    """Rows in order of samples up to the first whose error is below the target."""
    made = []
    for row in sorted(rows, key=lambda row: row["samples"]):
        made.append(row)
        if row["relMSE"] <= target:
            break
    return made


def summary(rows: list[dict], target: float) -> dict:
    """Seconds to the target, log-log between the two rows about it; None where it is not reached."""
    rows = until(rows, target)
    made = {kind: time_to(rows, target, kind) if rows else None for kind in ("frame", "whole")}
    return made | {"rows": rows, "samples": rows[-1]["samples"] if rows else None}


def ours(host: Host, scene: Scene, arguments, folder: pathlib.Path) -> dict:
    """Each count of samples in a process of its own."""
    keep = folder / "ours.exr"
    found = record(host, scene, 0, True, arguments.reference, REFERENCE_SEED, keep)
    if not found.is_good:
        return {"failed": found.status, "messages": found.messages}
    reference, rows, peak, device = exr_pixels.colors(keep), [], found.host_peak, 0
    for samples in counts(arguments.reference):
        run = record(host, scene, 0, False, samples, SEED, keep)
        if not run.is_good:
            return {"failed": run.status, "messages": run.messages}
        rows.append({
            "samples": samples, "relMSE": relative_mse(exr_pixels.colors(keep), reference), "whole": run.secs,
            "frame": run.report.get("row", {}).get("secondsTracing", run.secs), "cpu": run.cpu_secs,
        })  # fmt: skip
        peak = max(peak, run.host_peak)
        device = max(device, run.report.get("usage", {}).get("gpuPeakBytes", 0))
        if rows[-1]["relMSE"] <= arguments.target:
            break
    made = summary(rows, arguments.target) | {"host_peak": peak, "device_peak": device, "messages": found.messages}
    return made | {"reference": reference}


def cycles(scene: Scene, stage: dict, height: int, arguments, folder: pathlib.Path) -> dict:
    """All counts of samples in one process, so that the import is paid once."""
    renders = [[arguments.reference, REFERENCE_SEED], *([samples, SEED] for samples in counts(arguments.reference))]
    job = {
        "scene": str(scene.file), "camera": scene.camera or "main_cam", "frame": scene.frame,
        "shutter": stage["shutter"], "unit": stage["unit"], "normalized": stage["normalized"],
        "width": arguments.width, "height": height, "bounces": arguments.bounces, "renders": renders,
        "out": str(folder),
    }  # fmt: skip
    (folder / "job.json").write_text(json.dumps(job))
    command = [arguments.host_python, "-I", "-W", "ignore", str(HERE / "cycles_process.py"), str(arguments.blender)]
    run = watched([*command, str(folder / "job.json")], _plain(), arguments.limit * 2, folder)
    said = results(folder / "log.txt")
    made = {"host_peak": run.host_peak, "import": said.get("import"), "device": said.get("device", {}).get("device")}
    first = folder / f"{arguments.reference}-{REFERENCE_SEED}.exr"
    if not first.exists():
        return made | {"failed": run.status, "messages": run.messages}
    reference, rows = exr_pixels.colors(first), []
    for one in said.get("renders", []):
        file = folder / f"{one['samples']}-{one['seed']}.exr"
        if one["seed"] == SEED and file.exists():
            rows.append({
                "samples": one["samples"], "relMSE": relative_mse(exr_pixels.colors(file), reference),
                "frame": one["seconds"], "whole": one["seconds"] + said["import"]["seconds"], "cpu": one["cpu"],
            })  # fmt: skip
    return made | summary(rows, arguments.target) | {"reference": reference}


MITSUBA = "python3 -m venv FOLDER; FOLDER/bin/pip install mitsuba==3.9.1 numpy; --mitsuba FOLDER/bin/python"


def missing_mitsuba(python: str) -> str | None:
    """Why a Python has no Mitsuba, None if it has."""
    command = [python, "-I", "-c", "import mitsuba, numpy"]
    try:
        done = subprocess.run(command, env=_plain(), capture_output=True, text=True, check=False)
    except OSError as error:
        return str(error)
    return ((done.stderr.strip().splitlines() or [f"exit {done.returncode}"])[-1]) if done.returncode else None


def mitsuba(scene: Scene, stage: dict, height: int, arguments, folder: pathlib.Path) -> dict:
    """The file written for Mitsuba by the Python that has pxr; all counts of samples in one process of its own."""
    renders = [[arguments.reference, REFERENCE_SEED], *([samples, SEED] for samples in counts(arguments.reference))]
    job = {
        "scene": str(scene.file), "camera": scene.camera or "main_cam", "frame": scene.frame,
        "shutter": stage["shutter"], "width": arguments.width, "height": height, "bounces": arguments.bounces,
        "triangles": arguments.mitsuba_triangles, "instances": arguments.mitsuba_instances,
        "variant": arguments.mitsuba_variant, "renders": renders, "reference_seed": REFERENCE_SEED, "out": str(folder),
    }  # fmt: skip
    (folder / "job.json").write_text(json.dumps(job))
    command = [arguments.python, str(HERE / "mitsuba_scene.py"), str(folder / "job.json")]
    run = watched(command, dict(os.environ), arguments.limit, folder)
    made = {"scene": results(folder / "log.txt").get("scene", {})}
    if not run.is_good:
        refused = made["scene"].get("refused")
        return made | {"failed": "refused" if refused else run.status, "messages": [refused] if refused else run.messages}
    command = [str(arguments.mitsuba), "-I", str(HERE / "mitsuba_process.py"), str(folder / "job.json")]
    run = watched(command, _plain(), arguments.limit * 2, folder)
    said = results(folder / "log.txt")
    made |= {"host_peak": run.host_peak, "load": said.get("load"), "compile": said.get("compile", {}).get("seconds")}
    first = folder / f"mitsuba-{arguments.reference}-{REFERENCE_SEED}.exr"
    if not first.exists():
        return made | {"failed": run.status, "messages": run.messages}
    reference, rows = exr_pixels.colors(first), []
    for one in said["renders"]:
        file = folder / f"mitsuba-{one['samples']}-{one['seed']}.exr"
        if one["seed"] == SEED and file.exists():
            rows.append({
                "samples": one["taken"], "relMSE": relative_mse(exr_pixels.colors(file), reference),
                "frame": one["seconds"], "whole": one["seconds"] + said["load"]["seconds"], "cpu": one["cpu"],
            })  # fmt: skip
    return made | summary(rows, arguments.target) | {"reference": reference}


def _plain() -> dict[str, str]:
    """The environment without what leads to another OpenUSD."""
    return {key: value for key, value in os.environ.items() if not key.startswith(("PXR_", "PYTHON", "LD_LIBRARY"))}


def results(log: pathlib.Path) -> dict:
    """What a process told: its scene or import, the device, the renders."""
    made: dict = {"renders": []}
    for line in log.read_text(errors="replace").splitlines():
        if line.startswith("RESULT "):
            said = json.loads(line.removeprefix("RESULT "))
            if said["kind"] == "render":
                made["renders"].append(said)
            else:
                made[said["kind"]] = said
    return made


STAGE = """
import json, sys
from pxr import Usd, UsdGeom, UsdLux
stage = Usd.Stage.Open(sys.argv[1])
name, frame = sys.argv[2], float(sys.argv[3]) if sys.argv[3] else Usd.TimeCode.EarliestTime()
kinds = {}
for prim in Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()):
    if prim.IsA(UsdGeom.Imageable) and not prim.IsA(UsdGeom.Scope):
        kinds[prim.GetTypeName()] = kinds.get(prim.GetTypeName(), 0) + 1
cameras = [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Camera)]
named = [prim for prim in cameras if str(prim.GetPath()) == name or prim.GetName() == name]
camera = UsdGeom.Camera((named or cameras)[0])
window = camera.GetCamera(frame).frustum.window.GetSize()
shutter = camera.GetShutterCloseAttr().Get(frame) - camera.GetShutterOpenAttr().Get(frame)
lights = [UsdLux.LightAPI(prim) for prim in stage.Traverse() if prim.HasAPI(UsdLux.LightAPI)]
made = {"prims": kinds, "aspect": window[1] / window[0], "shutter": shutter}
made["unit"] = UsdGeom.GetStageMetersPerUnit(stage)
made["normalized"] = [light.GetPrim().GetName() for light in lights if light.GetNormalizeAttr().Get()]
print(json.dumps(made))
"""


def stage_of(scene: Scene, python: str) -> dict:
    """What is in a file, the shape of its picture, how long the shutter is open."""
    command = [python, "-c", STAGE, str(scene.file), scene.camera or "main_cam", scene.frame]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def compare(host: Host, scene: Scene, arguments) -> dict:
    """All renderers on a file; one that fails says so."""
    found = stage_of(scene, arguments.python)
    height = max(round(arguments.width * found["aspect"]), 1)
    made: dict = {"scene": scene.name, "size": [arguments.width, height], **found, "apart": {}}
    with tempfile.TemporaryDirectory(prefix="beside-", dir=arguments.work) as folder:
        made["ours"] = ours(host, scene, arguments, pathlib.Path(folder))
        for name in arguments.others:
            made[name] = RENDERERS[name](scene, found, height, arguments, pathlib.Path(folder))
    picture = made["ours"].pop("reference", None)
    pictures = {name: made[name].pop("reference", None) for name in arguments.others}
    for name, other in pictures.items():
        if picture is not None and other is not None and picture.shape == other.shape:
            made["apart"][name] = apart(picture, other)
    shown = [one for one in (picture, *pictures.values()) if one is not None]
    if arguments.pictures and len(shown) > 1:
        save(arguments.pictures / f"{scene.name}.png", shown)
    return made


RENDERERS = {"cycles": cycles, "mitsuba": mitsuba}
REGIONS = 3, 4
"""Rows and columns of a picture."""


def apart(picture, other) -> dict:
    """How far two pictures are apart: as a whole, and the means of both by region, row by row."""
    regions = [
        [float(part.mean()) for part in pair]
        for rows in zip(*(_pieces(one, 0) for one in (picture, other)))
        for pair in zip(*(_pieces(one, 1) for one in rows))
    ]
    means = [float(picture.mean()), float(other.mean())]
    return {"relMSE": relative_mse(picture, other), "means": means, "regions": regions}


def _pieces(picture, axis: int) -> list:
    """As equal as they can be; never empty."""
    import numpy as np

    return np.array_split(picture, min(REGIONS[axis], picture.shape[axis]), axis)


def worst_region(regions: list[list[float]]) -> str:
    """The region whose means are furthest apart by their ratio, counted from the upper left."""
    far = lambda at: max(regions[at]) / max(min(regions[at]), 1e-9)
    at = max(range(len(regions)), key=far)
    return f"region {at + 1}: {regions[at][0]:.3f}, {regions[at][1]:.3f}"


def save(path: pathlib.Path, pictures: list) -> None:
    """The converged pictures, ours on the left."""
    import numpy as np

    sys.path.insert(0, str(measure_sets.SCENES))
    import images

    path.parent.mkdir(parents=True, exist_ok=True)
    images.png(path, images.to_8_bit(images.to_srgb(np.concatenate(pictures, 1))), packed=True)


def lines(result: dict) -> list[str]:
    """Rows of the table in Markdown, one for each renderer beside ours."""
    return [line(result, name) for name in RENDERERS if name in result]


def line(result: dict, name: str) -> str:
    a, b = result["ours"], result[name]

    def seconds(side: dict, kind: str) -> str:
        if "failed" in side:
            return side["failed"]
        return "not reached" if side[kind] is None else f"{side[kind]:.2f}"

    def ratio(kind: str) -> str:
        return f"{b[kind] / a[kind]:.2f}" if a.get(kind) and b.get(kind) else "-"

    apart = result["apart"].get(name)
    words = [result["scene"], name.capitalize()]
    for kind in ("frame", "whole"):
        words += [seconds(a, kind), seconds(b, kind), ratio(kind)]
    words += [f"{side['host_peak'] / MIB:.0f}" if side.get("host_peak") else "-" for side in (a, b)]
    if apart:
        words.append(f"{apart['means'][0]:.3f}, {apart['means'][1]:.3f}; {apart['relMSE']:.1e}")
    words.append(worst_region(apart["regions"]) if apart else "-")
    return "| " + " | ".join(words if apart else [*words[:-1], "-", "-"]) + " |"


HEAD = (
    "| scene | beside | frame, s | its | ratio | whole, s | its | ratio | host MiB | its | means; apart | furthest |\n"
    "|---|---|---|---|---|---|---|---|---|---|---|---|"
)


def others(arguments) -> list[str]:
    """The renderers that are there; a line for each that was asked for and is not."""
    made = ["cycles"] if arguments.blender else []
    if arguments.blender and not (arguments.blender / "bpy").exists():
        print(f"Cycles is left out: {arguments.blender} holds no bpy", file=sys.stderr)
        made = []
    if arguments.mitsuba:
        why = missing_mitsuba(arguments.mitsuba)
        if why is None:
            made.append("mitsuba")
        else:
            print(f"Mitsuba is left out: {why}; to have it: {MITSUBA}", file=sys.stderr)
    return made


def main() -> int:
    parser = measure_sets.make_parser()
    parser.prog = "cargo xtask bench beside"
    parser.set_defaults(width=160, bounces=5)
    add = parser.add_argument
    add("--target", type=float, default=5e-2, help="relMSE")
    add("--reference", type=int, default=256, help="samples of each converged picture")
    add("--blender", type=pathlib.Path, help="folder that holds bpy")
    add("--host-python", default=os.environ.get("OOCPT_HOST_PYTHON", sys.executable), help="one that can import bpy")
    add("--mitsuba", help="a Python that has mitsuba and numpy")
    add("--mitsuba-variant", default="", help="cuda_ad_rgb where there is a GPU, else scalar_rgb")
    add("--mitsuba-triangles", type=int, default=50_000_000, help="most triangles that are stored")
    add("--mitsuba-instances", type=int, default=2_000_000)
    add("--pictures", type=pathlib.Path, help="folder for the converged pictures, ours on the left")
    arguments = parser.parse_args()
    if not (arguments.blender or arguments.mitsuba):
        parser.error("--blender FOLDER or --mitsuba PYTHON")
    arguments.others = others(arguments)
    arguments.work = arguments.work.resolve()
    arguments.work.mkdir(parents=True, exist_ok=True)
    host = Host(
        arguments.usdrecord, arguments.work, arguments.width, 1, arguments.limit, arguments.bounces, arguments.device
    )
    results_made = []
    print(HEAD)
    for scene in measure_sets.scenes_of(arguments):
        try:
            result = compare(host, scene, arguments)
        except (OSError, ValueError, subprocess.CalledProcessError) as error:
            print(f"{scene.name}: {error}", file=sys.stderr)
            continue
        results_made.append(result)
        print("\n".join(lines(result) or [f"{scene.name}: nothing beside it"]), flush=True)
        if arguments.json:
            made = {key: getattr(arguments, key) for key in ("seed", "size", "target", "reference", "bounces")}
            arguments.json.write_text(json.dumps(made | {"results": results_made}, indent=1) + "\n")
    return 0 if results_made else 1


if __name__ == "__main__":
    sys.exit(main())
