#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Seconds until a picture's relMSE is below 1e-2, ours and Mitsuba's, on this machine.

    time_to_error.py SCENE [--width 320] [--bounces 5] [--target 1e-2] [--reference 4096] [--json OUT.json]
    time_to_error.py --gallery still_life --gallery lanterns ...    (scenes as `cargo xtask gallery` wrote them)

How it is measured:
- Each renderer is judged against a converged picture of its own (`--reference` samples, another seed): what is measured
  is noise, and models that differ by a per cent do not count as error. How far the two converged pictures are apart is
  printed (`apart`), so that it is seen whether they are the same scene at all.
- relMSE = mean over pixels and channels of (x - r)^2 / (r^2 + 1e-2), the same function for both.
- Rough dielectrics are Mitsuba's `principled`: its `roughplastic` loses so much light where rough that pictures were
  half as bright, and with that less noisy to relMSE, which counts dark pixels less.
- Same camera, pixels, box filter and number of bounces; neither clamps. Mitsuba draws from its multi-jittered sampler
  and ends paths by roulette as it comes (rr_depth 5); ours draws from Owen-scrambled Sobol points, its roulette begins
  at bounce 3.
- Sample counts 1, 2, 4, ... until the target is met; the time to the target is read off log-log between the last two.
  Three seeds each; medians.
- Seconds are those of rendering: `mi.render` after a warm-up of the same shape (kernels are compiled once), and ours
  from Hydra's first execution to convergence in a live engine that has rendered once (pipelines made, scene uploaded).
  Translation, loading and compiling are printed apart.
- `cpu` is processor time of the same renders. It hardly depends on what else the machine does: where cores are shared,
  its ratio is the one to read.
- `variance` is relMSE at equal samples, Mitsuba's by ours: what is won by sampling; the rest of the ratio is speed.

Variants: OOCPT_MITSUBA_VARIANT=llvm_ad_rgb (default) against lavapipe, cuda_ad_rgb against a GPU. Ours runs in the
wheel host, by tests/hydra/host.py, without the validation layer. Run by `cargo xtask reference time_to_error ...` after
`cargo xtask build`.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import pathlib
import resource
import statistics
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "hydra")]

import numpy as np  # noqa: E402

SEEDS = 3
PROBE = 16
"""Samples that tell how long a reference will take."""
MAX_WARM_UP_SAMPLES = 1024
"""Samples: counts above this are only rendered as references."""
SAMPLER = "multijitter"
"""Mitsuba's own stratified sampler: less noise than its independent one, which is what it takes without being told."""
ROULETTE = 5
"""Mitsuba's own default: its `path` ends paths at random from this depth on."""
REFERENCE_SEED = 90


TICK = os.sysconf("SC_CLK_TCK")


def cpu_seconds(pid: int | None = None) -> float:
    """Processor time of a process so far, all of its threads; of this one without `pid`."""
    if pid is None:
        used = resource.getrusage(resource.RUSAGE_SELF)
        return used.ru_utime + used.ru_stime
    # Fields 14 and 15, counted behind the name, which may hold spaces.
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICK


def relative_mse(picture: np.ndarray, reference: np.ndarray) -> float:
    return float(np.mean((picture - reference) ** 2 / (reference**2 + 1e-2)))


def expect_whole(log: str) -> None:
    """Shows what OocPT says of a scene. A picture without its textures has less noise: it must not count."""
    said = [line.partition("OocPT: ")[2] for line in log.splitlines() if "OocPT: " in line]
    for line in said:
        print(f"  OocPT says: {line}", flush=True)
    lost = [line for line in said if "left out" in line or "cannot be read" in line or "fallback is used" in line]
    if lost:
        raise SystemExit(f"a part of the scene is missing: {lost[0]}")


class Ours:
    """OocPT in a live Hydra engine."""

    name = "OocPT"

    def __init__(self, scene: str, width: int, height: int, bounces: int, folder: pathlib.Path) -> None:
        from host import Host

        self._host = Host(
            folder, scene_index=True, environment={"OOCPT_VALIDATION": "0", "OOCPT_ENABLE_INTERACTIVE": "false"}
        )
        start = time.monotonic()
        self._view = self._host.open(
            scene, (width, height), settings={"oocpt:samplesPerPixel": 1, "oocpt:maxBounces": bounces}
        )
        expect_whole(self._view.render(600).log)
        self.setup = time.monotonic() - start
        self.settings = self._view.stats()

    def render(self, samples: int, seed: int) -> tuple[np.ndarray, float, float]:
        before = cpu_seconds(self._host.pid)
        self._view.edit(
            f"engine.SetRendererSetting('oocpt:samplesPerPixel', {samples}); engine.SetRendererSetting('oocpt:seed',"
            f" {seed})"
        )
        picture = self._view.render(3600)
        return picture["color"][::-1, :, :3].astype(np.float64), picture.seconds, cpu_seconds(self._host.pid) - before

    def close(self) -> None:
        self._view.__exit__()
        self._host.close()


class Mitsuba:
    """Mitsuba's path integrator; kernels are compiled once per shape of the launch."""

    def __init__(self, scene: str, width: int, height: int, bounces: int) -> None:
        import materials
        import mitsuba as mi
        import to_mitsuba

        materials.PRINCIPLED_PLASTICS = True

        self._to, self.name = to_mitsuba, f"Mitsuba {mi.variant()}"
        start = time.monotonic()
        self._scene, self.notes = to_mitsuba.translate(
            scene, width, height, bounces=bounces, sampler=SAMPLER, roulette=ROULETTE
        )
        to_mitsuba.render(self._scene, 1)
        self.setup = time.monotonic() - start
        self._warm: set[int] = set()

    def render(self, samples: int, seed: int) -> tuple[np.ndarray, float, float]:
        # A reference is not timed: it is large enough to be its own warm-up.
        if samples not in self._warm and samples <= MAX_WARM_UP_SAMPLES:
            self._to.render(self._scene, samples, 77)
            self._warm.add(samples)
        start, before = time.monotonic(), cpu_seconds()
        picture = self._to.render(self._scene, samples, seed)
        return picture, time.monotonic() - start, cpu_seconds() - before

    def close(self) -> None:
        pass


def reference_count(most: int, limit: float, probe: float) -> int:
    """Samples of a reference: `most`, halved until it should take `limit` seconds, when PROBE samples took `probe`;
    never below PROBE."""
    while most > PROBE and probe * most / PROBE > limit:
        most //= 2
    return most


def measure(renderer, target: float, most: int, limit: float) -> dict:
    """Rows of samples, seconds, cpu and relMSE, the times to the target, and the converged picture."""
    reference_samples = reference_count(most, limit, renderer.render(PROBE, REFERENCE_SEED)[1])
    reference, seconds, _ = renderer.render(reference_samples, REFERENCE_SEED)
    print(
        f"  {renderer.name}: set up {renderer.setup:.1f} s; reference of {reference_samples} samples {seconds:.1f} s",
        file=sys.stderr,
    )
    rows, samples = [], 1
    while True:
        found = [renderer.render(samples, seed) for seed in range(SEEDS)]
        # The reference's own noise is in what is measured; it adds its variance.
        row = {
            "samples": samples, "seconds": statistics.median(s for _, s, _ in found),
            "cpu": statistics.median(c for _, _, c in found),
            "relMSE": statistics.median(relative_mse(p, reference) for p, _, _ in found),
        }  # fmt: skip
        rows.append(row)
        print(
            f"  {renderer.name}: {samples:6d} samples {row['seconds']:9.4f} s {row['cpu']:9.3f} s cpu  relMSE"
            f" {row['relMSE']:.3e}",
            file=sys.stderr,
        )
        if row["relMSE"] <= target or samples * 4 > reference_samples:
            break
        samples *= 2
    return {
        "rows": rows, "seconds": time_to(rows, target), "cpu": time_to(rows, target, "cpu"), "setup": renderer.setup,
        "reference_samples": reference_samples, "reference_seconds": seconds, "reference": reference,
    }


def time_to(rows: list[dict], target: float, kind: str = "seconds") -> float | None:
    """Seconds at which relMSE falls to the target, log-log between the two rows around it; None if it was not
    reached."""
    if rows[-1]["relMSE"] > target:
        return None
    if len(rows) == 1:
        return rows[0][kind]
    (t0, e0), (t1, e1) = ((max(row[kind], 1e-6), row["relMSE"]) for row in rows[-2:])
    share = (math.log(e0) - math.log(target)) / (math.log(e0) - math.log(e1))
    return math.exp(math.log(t0) + share * (math.log(t1) - math.log(t0)))


def variance_ratio(ours: list[dict], theirs: list[dict]) -> float:
    """Mitsuba's relMSE by ours at the most samples that both have."""
    a, b = ({row["samples"]: row["relMSE"] for row in rows} for rows in (ours, theirs))
    most = max(a.keys() & b.keys())
    return b[most] / a[most]


def compare(scene: str, arguments) -> dict:
    import to_mitsuba  # sets the variant
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(scene)
    window = UsdGeom.Camera(stage.GetPrimAtPath("/World/Camera")).GetCamera(Usd.TimeCode.Default()).frustum.window
    height = round(arguments.width * (window.max[1] - window.min[1]) / (window.max[0] - window.min[0]))
    made, converged = {}, {}
    with tempfile.TemporaryDirectory() as folder:
        size = (arguments.width, height, arguments.bounces)
        sides = {"ours": lambda: Ours(scene, *size, pathlib.Path(folder)), "mitsuba": lambda: Mitsuba(scene, *size)}
        for key in [arguments.only] if arguments.only else sides:
            opened = sides[key]()
            made[key] = measure(opened, arguments.target, arguments.reference, arguments.reference_seconds)
            made[key]["name"] = opened.name
            converged[key] = made[key].pop("reference")
            for note in getattr(opened, "notes", []):
                print(f"  note: {note}", file=sys.stderr)
            opened.close()
    if len(converged) == 2:
        a, b = converged["ours"], converged["mitsuba"]
        made["apart"] = {
            "relMSE": relative_mse(a, b),
            "means": [a.mean(axis=(0, 1)).tolist(), b.mean(axis=(0, 1)).tolist()],
        }
    if arguments.pictures:
        beside = to_mitsuba.tone(np.concatenate(list(converged.values()), axis=1))
        to_mitsuba.mi.Bitmap(beside).write(str(arguments.pictures / f"{pathlib.Path(scene).stem}.png"))
    made.update(
        scene=pathlib.Path(scene).stem, size=[arguments.width, height], bounces=arguments.bounces,
        target=arguments.target, version=to_mitsuba.mi.__version__,
    )
    return made


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("scenes", nargs="*")
    parser.add_argument("--gallery", action="append", default=[])
    parser.add_argument("--width", type=int, default=320)
    parser.add_argument("--bounces", type=int, default=5)
    parser.add_argument("--target", type=float, default=1e-2)
    parser.add_argument("--reference", type=int, default=4096, help="samples of each converged picture")
    parser.add_argument(
        "--reference-seconds", type=float, default=3600,
        help="halves the samples of a converged picture until it takes less",
    )
    parser.add_argument("--only", choices=("ours", "mitsuba"), help="one side only")
    parser.add_argument("--pictures", type=pathlib.Path, help="folder for the converged pictures, ours on the left")
    parser.add_argument("--json", type=pathlib.Path)
    arguments = parser.parse_args()
    built = HERE.parents[1] / "build" / "gallery" / "scenes"
    results = []
    for scene in [*arguments.scenes, *(str(built / name / f"{name}.usdc") for name in arguments.gallery)]:
        print(scene, file=sys.stderr)
        results.append(compare(scene, arguments))
        # After each scene: what is measured is not lost when the next one takes too long.
        if arguments.json:
            arguments.json.write_text(json.dumps(results, indent=1) + "\n")
    print(f"time to relMSE {arguments.target:g}, width {arguments.width}, {arguments.bounces} bounces")
    print(
        "| scene | ours, s (samples) | Mitsuba, s (samples) | Mitsuba / ours | by cpu | variance | apart, relMSE |\n"
        "|---|---|---|---|---|---|---|"
    )
    for result in results:
        print(line(result))


def line(result: dict) -> str:
    """A result's row of the table."""

    def text(key: str) -> str:
        if key not in result:
            return "-"
        last, seconds = result[key]["rows"][-1], result[key]["seconds"]
        return (
            f"more than {last['seconds']:.3g} ({last['samples']})"
            if seconds is None
            else f"{seconds:.3g} ({last['samples']})"
        )

    def ratio(kind: str) -> str:
        a, b = (result.get(key, {}).get(kind) for key in ("ours", "mitsuba"))
        return f"{b / a:.2f}" if a and b else "-"

    variance = f"{variance_ratio(result['ours']['rows'], result['mitsuba']['rows']):.2f}" if "apart" in result else "-"
    apart = f"{result['apart']['relMSE']:.1e}" if "apart" in result else "-"
    return (
        f"| {result['scene']} | {text('ours')} | {text('mitsuba')} | {ratio('seconds')} | {ratio('cpu')} | {variance} |"
        f" {apart} |"
    )


if __name__ == "__main__":
    main()
