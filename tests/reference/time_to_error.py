#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Seconds until a picture's relMSE is below 1e-2, ours and Mitsuba's, on this machine.

    time_to_error.py SCENE [--width 320] [--bounces 5] [--target 1e-2] [--reference 8192] [--json OUT.json]
    time_to_error.py --gallery still_life --gallery room ...        (scenes as `cargo xtask gallery` wrote them)

How it is measured:
- Each renderer is judged against a converged picture of its own (`--reference` samples, another seed): what is measured is noise, and models
  that differ by a per cent do not count as error. How far the two converged pictures are apart is printed (`apart`), so that it is seen whether
  they are the same scene at all.
- relMSE = mean over pixels and channels of (x - r)^2 / (r^2 + 1e-2).
- Mitsuba draws from its multi-jittered sampler, ours from Owen-scrambled Sobol points.
- Sample counts 1, 2, 4, ... until the target is met; the time to the target is read off log-log between the last two. Three seeds each; medians.
- Seconds are those of rendering: `mi.render` after one warm-up of the same shape (kernels are compiled once), and ours from Hydra's first execution
  to convergence in a live engine that has rendered once (pipelines made, scene uploaded). Translation, loading and compiling are printed apart.

Variants: OOCPT_MITSUBA_VARIANT=llvm_ad_rgb (default) against lavapipe, cuda_ad_rgb against a GPU. Ours runs in the wheel host, by tests/hydra/host.py,
without the validation layer. Run by `cargo xtask reference time_to_error ...` after `cargo xtask build`.
"""

from __future__ import annotations

import argparse
import json
import math
import pathlib
import statistics
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "hydra")]

import numpy as np  # noqa: E402

SEEDS = 3
SAMPLER = "multijitter"
"""Mitsuba's own stratified sampler: less noise than its independent one, which is what it takes without being told."""
FIRST_REFERENCE_SEED = 90


def relative_mse(picture: np.ndarray, reference: np.ndarray) -> float:
    return float(np.mean((picture - reference) ** 2 / (reference**2 + 1e-2)))


class Ours:
    """OocPT in a live Hydra engine."""

    name = "OocPT"

    def __init__(self, scene: str, width: int, height: int, bounces: int, folder: pathlib.Path) -> None:
        from host import Host

        self._host = Host(folder, scene_index=True, environment={"OOCPT_VALIDATION": "0", "OOCPT_ENABLE_INTERACTIVE": "false"})
        start = time.monotonic()
        self._view = self._host.open(scene, (width, height), settings={"oocpt:samplesPerPixel": 1, "oocpt:maxBounces": bounces})
        self._view.render(600)
        self.setup = time.monotonic() - start
        self.settings = self._view.stats()

    def render(self, samples: int, seed: int) -> tuple[np.ndarray, float]:
        self._view.edit(f"engine.SetRendererSetting('oocpt:samplesPerPixel', {samples}); engine.SetRendererSetting('oocpt:seed', {seed})")
        picture = self._view.render(3600)
        return picture["color"][::-1, :, :3].astype(np.float64), picture.seconds

    def close(self) -> None:
        self._view.__exit__()
        self._host.close()


class Mitsuba:
    """Mitsuba's path integrator; kernels are compiled once per shape of the launch."""

    def __init__(self, scene: str, width: int, height: int, bounces: int) -> None:
        import mitsuba as mi
        import to_mitsuba

        self._to, self.name = to_mitsuba, f"Mitsuba {mi.variant()}"
        start = time.monotonic()
        self._scene, self.notes = to_mitsuba.translate(scene, width, height, bounces=bounces, sampler=SAMPLER)
        to_mitsuba.render(self._scene, 1)
        self.setup = time.monotonic() - start
        self._warm: set[int] = set()

    def render(self, samples: int, seed: int) -> tuple[np.ndarray, float]:
        if samples not in self._warm and samples <= 64:
            self._to.render(self._scene, samples, 77)
            self._warm.add(samples)
        start = time.monotonic()
        picture = self._to.render(self._scene, samples, seed)
        return picture, time.monotonic() - start

    def close(self) -> None:
        pass


def measure(renderer, target: float, reference_samples: int) -> dict:
    """Rows of (samples, seconds, relMSE), the time to the target, and the converged picture."""
    reference, seconds = renderer.render(reference_samples, FIRST_REFERENCE_SEED)
    print(f"  {renderer.name}: set up {renderer.setup:.1f} s; reference of {reference_samples} samples {seconds:.1f} s", file=sys.stderr)
    rows, samples = [], 1
    while True:
        found = [renderer.render(samples, seed) for seed in range(SEEDS)]
        # The reference's own noise is in what is measured; it adds its variance.
        row = (samples, statistics.median(s for _, s in found), statistics.median(relative_mse(p, reference) for p, _ in found))
        rows.append(row)
        print(f"  {renderer.name}: {row[0]:6d} samples {row[1]:9.3f} s  relMSE {row[2]:.3e}", file=sys.stderr)
        if row[2] <= target or samples * 4 > reference_samples:
            break
        samples *= 2
    return {"rows": rows, "seconds": time_to(rows, target), "setup": renderer.setup, "reference": reference}


def time_to(rows: list[tuple], target: float) -> float | None:
    """Seconds at which relMSE falls to the target, log-log between the two rows around it; None if it was not reached."""
    if rows[-1][2] > target:
        return None
    if len(rows) == 1:
        return rows[0][1]
    (_, t0, e0), (_, t1, e1) = rows[-2:]
    share = (math.log(e0) - math.log(target)) / (math.log(e0) - math.log(e1))
    return math.exp(math.log(t0) + share * (math.log(t1) - math.log(t0)))


def compare(scene: str, arguments) -> dict:
    import to_mitsuba  # sets the variant
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(scene)
    window = UsdGeom.Camera(stage.GetPrimAtPath("/World/Camera")).GetCamera(Usd.TimeCode.Default()).frustum.window
    height = round(arguments.width * (window.max[1] - window.min[1]) / (window.max[0] - window.min[0]))
    made = {}
    with tempfile.TemporaryDirectory() as folder:
        for key, renderer in (("ours", lambda: Ours(scene, arguments.width, height, arguments.bounces, pathlib.Path(folder))), ("mitsuba", lambda: Mitsuba(scene, arguments.width, height, arguments.bounces))):
            opened = renderer()
            made[key] = measure(opened, arguments.target, arguments.reference)
            made[key]["name"] = opened.name
            for note in getattr(opened, "notes", []):
                print(f"  note: {note}", file=sys.stderr)
            opened.close()
    a, b = made["ours"].pop("reference"), made["mitsuba"].pop("reference")
    made["apart"] = {"relMSE": relative_mse(a, b), "means": [a.mean(axis=(0, 1)).tolist(), b.mean(axis=(0, 1)).tolist()]}
    made.update(scene=pathlib.Path(scene).stem, size=[arguments.width, height], bounces=arguments.bounces, target=arguments.target, version=to_mitsuba.mi.__version__)
    return made


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("scenes", nargs="*")
    parser.add_argument("--gallery", action="append", default=[])
    parser.add_argument("--width", type=int, default=320)
    parser.add_argument("--bounces", type=int, default=5)
    parser.add_argument("--target", type=float, default=1e-2)
    parser.add_argument("--reference", type=int, default=8192, help="samples of each converged picture")
    parser.add_argument("--json", type=pathlib.Path)
    arguments = parser.parse_args()
    built = HERE.parents[1] / "build" / "gallery" / "scenes"
    results = []
    for scene in [*arguments.scenes, *(str(built / name / f"{name}.usdc") for name in arguments.gallery)]:
        print(scene, file=sys.stderr)
        results.append(compare(scene, arguments))
    print(f"time to relMSE {arguments.target:g}, width {arguments.width}, {arguments.bounces} bounces")
    print("| scene | ours, s (samples) | Mitsuba, s (samples) | Mitsuba / ours | apart, relMSE |\n|---|---|---|---|---|")
    for result in results:
        text = lambda side: f"{side['seconds']:.3g} ({side['rows'][-1][0]})" if side["seconds"] is not None else f"more than {side['rows'][-1][1]:.3g} ({side['rows'][-1][0]})"
        ours, theirs = result["ours"], result["mitsuba"]
        ratio = f"{theirs['seconds'] / ours['seconds']:.2f}" if ours["seconds"] and theirs["seconds"] else "-"
        print(f"| {result['scene']} | {text(ours)} | {text(theirs)} | {ratio} | {result['apart']['relMSE']:.1e} |")
    if arguments.json:
        arguments.json.write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    main()
