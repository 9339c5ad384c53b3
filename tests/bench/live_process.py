# SPDX-License-Identifier: Apache-2.0
"""One scene in a live host without a window, in a process of its own: moves of the camera and edits, and what was shown
when. Started by measure_live.py in the wheel host's Python.

    live_process.py FILE CAMERA FRAME WIDTH HEIGHT SAMPLES MOVES LIMIT

Writes one JSON line for the start and one for each kind of move. The host executes every 4 ms, as one with a window
does at most. Of each move, in seconds: the longest execution (the host's own thread is held), when the first picture of
a job that came after it was shown (of moves that do not wait: the first other picture), when one with a sample at full
resolution, and the largest share of pixels of any picture shown that had none.
"""

from __future__ import annotations

import json
import pathlib
import resource
import sys
import time

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdLux, Vt

sys.path[:0] = [str(pathlib.Path(__file__).resolve().parents[1] / "hydra")]

import host_process  # noqa: E402  finds the product's aov_reader
from host_process import aov_reader  # noqa: E402

PAUSE = 0.004
PERIOD = 1 / 30


class LiveView:
    """A viewer, and what it last showed."""

    def __init__(self, stage, camera, frame, size, samples) -> None:
        settings = {"oocpt:samplesPerPixel": samples}
        self.view = host_process.Viewer(stage, size, camera, ["color", "sampleCount"], settings, ["proxy", "render"])
        if frame:
            self.view.params.frame = Usd.TimeCode(float(frame))
        self.stats = {}

    def step(self) -> float:
        """One execution; seconds that it held the thread."""
        begun = time.monotonic()
        self.is_converged = self.view.step()
        held = time.monotonic() - begun
        self.stats = self.view.stats()
        return held

    @property
    def shown(self) -> int:
        return self.stats["oocpt:shownJob"]

    def shows_newest(self, before: int) -> bool:
        return self.shown > before and self.shown == self.stats["oocpt:job"]

    def is_full(self) -> bool:
        return self.stats["numCompletedSamples"] >= 1

    def empty_share(self) -> float:
        """Of the picture on the screen."""
        counts = aov_reader.read(self.view.engine, "sampleCount")
        return 1.0 if counts is None else float((counts < 1).mean())


def start(live: LiveView, limit: float) -> dict:
    begun, held, first = time.monotonic(), 0.0, None
    live.view.prepare()
    while True:
        held = max(held, live.step())
        now = time.monotonic() - begun
        if first is None and live.shown > 0:
            first = now
        if live.is_converged or now > limit:
            return {"move": "start", "held": held, "first": first, "converged": now if live.is_converged else None}
        time.sleep(PAUSE)


def move(live: LiveView, change, period: float | None, limit: float) -> dict:
    """Makes one change and looks on: until a full picture of it is shown, or for `period` seconds."""
    seen = live.shown
    before = seen if period else live.stats["oocpt:job"]
    change()
    begun = time.monotonic()
    row = {"held": 0.0, "first": None, "full": None, "empty": 0.0, "shown": 0}
    while True:
        row["held"] = max(row["held"], live.step())
        now = time.monotonic() - begun
        if live.shown != seen:
            seen, row["shown"] = live.shown, row["shown"] + 1
            row["empty"] = max(row["empty"], live.empty_share())
        if row["first"] is None and live.shown > before:
            row["first"] = now
        if row["full"] is None and live.shows_newest(before) and live.is_full():
            row["full"] = now
        if now >= period if period else row["full"] is not None or now > limit:
            return row
        time.sleep(PAUSE)


def settle(live: LiveView, limit: float) -> None:
    """Lets edits and the picture of the last move come to an end."""
    begun = time.monotonic()
    while not (live.step() >= 0 and live.is_converged) and time.monotonic() - begun < limit:
        time.sleep(PAUSE)


def percentile(values: list[float], share: float) -> float | None:
    return float(np.percentile(values, 100 * share)) if values else None


def summary(name: str, rows: list[dict], made: int) -> dict:
    found = {"move": name, "moves": len(rows), "meshesMade": made}
    for key in ("held", "first", "full"):
        values = [row[key] for row in rows if row[key] is not None]
        found[key] = {"count": len(values), "median": percentile(values, 0.5), "p99": percentile(values, 0.99)}
    found["emptiest"] = max(row["empty"] for row in rows)
    found["shown"] = sum(row["shown"] for row in rows)
    return found


class Moves:
    """What a user does with a stage, all in its session layer."""

    def __init__(self, stage: Usd.Stage, camera: str, frame: str) -> None:
        self.stage, self.time = stage, Usd.TimeCode(float(frame)) if frame else Usd.TimeCode.EarliestTime()
        stage.SetEditTarget(stage.GetSessionLayer())
        self.camera = UsdGeom.Camera(stage.GetPrimAtPath(camera))
        self.start = UsdGeom.Xformable(self.camera).GetLocalTransformation(self.time)
        self.focal = self.camera.GetFocalLengthAttr().Get(self.time)
        self.matrix = UsdGeom.Xformable(self.camera).MakeMatrixXform()
        cache = UsdGeom.BBoxCache(self.time, ["default", "render"], useExtentsHint=True)
        extent = cache.ComputeWorldBound(stage.GetPseudoRoot()).ComputeAlignedRange().GetSize()
        # Scenes without bounds are as large as the camera is far from their middle.
        self.size = extent.GetLength() if np.isfinite(extent.GetLength()) and extent.GetLength() > 0 else 1.0

    def tumble(self, number: int):
        turn = Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(0, 1, 0), 0.2 * number))
        return lambda: self.matrix.Set(turn * self.start)

    def walk(self, number: int):
        way = Gf.Matrix4d().SetTranslate(Gf.Vec3d(0, 0, -2e-4 * self.size * number))
        return lambda: self.matrix.Set(way * self.start)

    def zoom(self, number: int):
        return lambda: self.camera.GetFocalLengthAttr().Set(self.focal * 1.02**number)

    def light(self):
        """Drags the intensity of the first light; None without one."""
        lights = (prim for prim in self.stage.Traverse() if prim.HasAPI(UsdLux.LightAPI))
        prim = next(lights, None)
        if prim is None:
            return None
        intensity = UsdLux.LightAPI(prim).GetIntensityAttr()
        base = intensity.Get(self.time)
        return lambda number: lambda: intensity.Set(base * (1 + 0.05 * number))

    def instance(self):
        """Drags one placement of the largest point instancer, else the first mesh; None without either."""
        found = [prim for prim in self.stage.Traverse() if prim.IsA(UsdGeom.PointInstancer)]
        positions = [UsdGeom.PointInstancer(prim).GetPositionsAttr() for prim in found]
        positions = [(len(attribute.Get(self.time) or ()), attribute) for attribute in positions]
        if positions:
            attribute = max(positions, key=lambda pair: pair[0])[1]
            places = np.array(attribute.Get(self.time), dtype=np.float32)

            def at(number: int):
                moved = places.copy()
                moved[0, 1] += 1e-3 * self.size * number
                return lambda: attribute.Set(Vt.Vec3fArray.FromNumpy(moved))

            return at
        prim = next((prim for prim in self.stage.Traverse() if prim.IsA(UsdGeom.Gprim)), None)
        if prim is None:
            return None
        base = UsdGeom.Xformable(prim).GetLocalTransformation(self.time)
        matrix = UsdGeom.Xformable(prim).MakeMatrixXform()
        lift = Gf.Vec3d(0, 1e-3 * self.size, 0)
        return lambda number: lambda: matrix.Set(base * Gf.Matrix4d().SetTranslate(lift * number))


def main() -> None:
    file, camera, frame, width, height, samples, count, limit = sys.argv[1:]
    limit, count = float(limit), int(count)
    stage = Usd.Stage.Open(file)
    if not camera:
        cameras = [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Camera)]
        camera = str(cameras[0].GetPath()) if cameras else ""
    if not camera or not stage.GetPrimAtPath(camera):
        raise SystemExit(f"{file}: no camera {camera}")
    live = LiveView(stage, camera, frame, (int(width), int(height)), int(samples))

    def tell(row: dict) -> None:
        usage = {"device": live.stats.get("oocpt:driverPeakBytes"), "inCore": live.stats.get("oocpt:inCore")}
        usage["host"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10
        print(json.dumps(row | usage), flush=True)

    tell(start(live, limit))
    moves = Moves(stage, camera, frame)
    kinds = [
        ("tumble", moves.tumble, None, count), ("tumble, 30 a second", moves.tumble, PERIOD, 5 * count),
        ("zoom", moves.zoom, None, count), ("walk", moves.walk, None, count),
        ("walk, 30 a second", moves.walk, PERIOD, 5 * count),
        ("light", moves.light(), None, count), ("instance", moves.instance(), None, count),
    ]  # fmt: skip
    for name, change, period, number in kinds:
        if change is None:
            continue
        made = live.stats["oocpt:meshesMade"]
        rows = [move(live, change(step), period, limit) for step in range(1, number + 1)]
        settle(live, limit)
        tell(summary(name, rows, live.stats["oocpt:meshesMade"] - made))


if __name__ == "__main__":
    main()
