# SPDX-License-Identifier: Apache-2.0
"""The bench of whole sets: what it makes of processes that go well and badly, the order of its table, and that the sets
can be made; one of them is rendered."""

import importlib
import json
import math
import os
import pathlib
import sys
import types

import pytest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

import measure_sets as bench
import usdrecord_runs as runs

HERE = pathlib.Path(__file__).resolve().parent
FAKE = [sys.executable, str(HERE / "fake_usdrecord.py")]


@pytest.fixture
def host(tmp_path):
    return runs.Host(FAKE, tmp_path, 16, 4, 1.5)


def measured(host, name, percents=(50.0,), caches=("cold", "warm")):
    rows = []
    scene = runs.Scene(name, pathlib.Path(f"{name}.usda"))
    assert bench.measure(host, scene, list(percents), list(caches), rows.append) == rows
    return rows


def test_each_budget_is_a_share_of_what_the_render_without_one_took(host):
    rows = measured(host, "good", (75.0, 14.0))
    assert [(row.percent, row.budget_mib, row.cache) for row in rows] == [
        (None, 0, "cold"), (None, 0, "warm"), (75.0, 75, "cold"), (75.0, 75, "warm"), (14.0, 14, "cold"),
        (14.0, 14, "warm"),
    ]  # fmt: skip
    assert all(row.status == "ok" and row.same is True and not row.is_bad for row in rows)
    assert [row.tracing_secs for row in rows] == [0.4, 0.1] * 3, "cold begins with empty caches, warm with filled ones"
    last = rows[-1]
    assert (last.loads, last.paged_bytes, last.device_peak, last.rays_per_sec) == (7, 2 << 20, 14 << 20, 10000.0)
    assert last.host_peak > 1 << 20 and last.secs > 0 and last.ratio > 0


@pytest.mark.parametrize(
    ("name", "status"), [("fails", "exit 3"), ("dies", "signal 9"), ("hangs", "none in 1.5 s")]
)
def test_a_row_without_a_picture_says_why_and_stops_nothing(host, name, status):
    rows = measured(host, name, caches=("warm",), percents=(50.0,))
    assert [row.status for row in rows] == ["ok", status]
    assert rows[1].is_bad and rows[1].same is None and rows[1].ratio is None
    if name == "fails":
        assert rows[1].messages == ["OocPT: error: a scene that needs more"]
    if name == "hangs":
        assert 1.5 <= rows[1].secs < 20.0, "ended at the limit"


def test_other_bits_and_more_memory_than_the_budget_are_bad(host):
    other, over = measured(host, "differs", caches=("warm",))[1], measured(host, "over", caches=("warm",))[1]
    assert (other.same, other.is_over, other.is_bad) == (False, False, True)
    assert (over.same, over.is_over, over.is_bad) == (True, True, True)
    assert "NO" in bench.line(other) and "51.0!" in bench.line(over)


def test_a_program_that_is_not_there_is_a_row(tmp_path):
    rows = measured(runs.Host([str(tmp_path / "none")], tmp_path, 16, 4, 3.0), "good", caches=("cold",))
    assert [row.status for row in rows] == ["not started"], "without a peak there are no budgets"


def test_the_worst_row_is_first(host):
    good = measured(host, "good", caches=("warm",))[1]
    made = lambda **changes: bench.Row(**{**vars(good), **changes})
    slow, slower = made(ratio=2.0), made(ratio=30.0)
    other, none = made(same=False, ratio=1.0), made(status="exit 1", ratio=None)
    assert bench.worst_first([slow, other, slower, none]) == [none, other, slower, slow]
    busy = made(ratio=1.0, cpu_ratio=40.0)
    assert bench.worst_first([slower, busy], "cpu") == [busy, slower]


def test_the_pixels_alone_are_compared(tmp_path):
    """A header of another length and content changes nothing, one byte of a block does."""
    sys.path.insert(0, str(HERE / "../hydra"))
    import numpy as np

    import images

    values = np.arange(48, dtype=np.float32).reshape(4, 4, 3)
    images.exr(tmp_path / "a.exr", values)
    data = (tmp_path / "a.exr").read_bytes()
    # An attribute more in front of the end of the header moves all offsets.
    note = b"note\0string\0" + (5).to_bytes(4, "little") + b"hello"
    start = runs._first_block(data) - 8 * 4 - 1
    offsets = np.frombuffer(data[start + 1 : start + 33], "<u8") + len(note)
    moved = data[:start] + note + b"\0" + offsets.tobytes() + data[start + 33 :]
    (tmp_path / "b.exr").write_bytes(moved)
    (tmp_path / "c.exr").write_bytes(moved[:-1] + bytes([moved[-1] ^ 1]))
    hashes = [runs.pixels_of(tmp_path / f"{name}.exr") for name in "abc"]
    assert hashes[0] == hashes[1] != hashes[2]
    for size in range(0, len(data), 37):
        (tmp_path / "cut.exr").write_bytes(data[:size])
        assert runs.pixels_of(tmp_path / "cut.exr") != hashes[0], "a file that was cut off"


def test_colours_are_read_as_openexr_reads_them(tmp_path):
    """Of all kinds that hosts write; what is cut off is an error."""
    import numpy as np

    import exr
    import images
    import exr_pixels

    rng = np.random.default_rng(4)
    for number, (channels, half, packed) in enumerate([(3, False, False), (4, True, True), (4, False, True)]):
        path = tmp_path / f"{number}.exr"
        smooth = np.cumsum(rng.random((37, 19, channels)), axis=0)
        images.exr(path, smooth, half=half, packed=packed)
        assert (exr_pixels.colors(path) == exr.read(path)[::-1, :, :3].astype(np.float64)).all()
        data = path.read_bytes()
        for size in range(0, len(data) - 1, 97):
            (tmp_path / "cut.exr").write_bytes(data[:size])
            with pytest.raises(ValueError):
                exr_pixels.colors(tmp_path / "cut.exr")


def test_the_time_to_an_error_is_read_between_two_rows():
    import beside

    rows = [{"samples": n, "relMSE": 0.2 / n, "frame": float(n), "whole": 3.0 + n} for n in (4, 1, 2)]
    made = beside.summary(rows, 0.1)
    assert (made["samples"], made["frame"], made["whole"]) == (2, pytest.approx(2.0), pytest.approx(5.0))
    assert beside.summary(rows, 0.01)["frame"] is None and beside.counts(64) == [1, 2, 4, 8, 16]


def test_lights_get_the_power_that_openusd_defines():
    """Numbers of Blender 5.0.1's importer for a sphere light of 2.5 cm and 250, a rect light of 90 cm by 30 and 45, and
    a normalized sun of 2.2 and 1.5 degrees."""
    import cycles_process

    ball = types.SimpleNamespace(type="POINT", energy=785.39819, shadow_soft_size=2.5)
    panel = types.SimpleNamespace(type="AREA", energy=141.37167, shape="RECTANGLE", size=90.0, size_y=30.0)
    sun = types.SimpleNamespace(type="SUN", energy=8.8, angle=0.05235988)
    for light in (ball, panel):
        cycles_process.as_defined(light, 0.01, False)
    cycles_process.as_defined(sun, 1.0, True)
    # Watts of a surface of this radiance on one side: radiance, pi, square metres.
    assert ball.energy == pytest.approx(250 * math.pi * 4 * math.pi * 0.025**2, rel=1e-6)
    assert panel.energy == pytest.approx(45 * math.pi * 0.9 * 0.3, rel=1e-6)
    assert (sun.energy, math.degrees(sun.angle)) == (pytest.approx(2.2), pytest.approx(1.5))


def test_a_damaged_report_is_read_as_far_as_it_goes(tmp_path):
    path = tmp_path / "report.jsonl"
    assert runs.report_of(path) == {}
    path.write_bytes(b'{"oocptErrorReport":1,"device":"d"}\n[1]\n\xff\n{"samples":2,"rays":5}\n{"usage":7}\n{"usa')
    assert runs.report_of(path) == {"device": "d", "row": {"samples": 2, "rays": 5}, "usage": {}}


def test_scenes_are_named_with_camera_and_frame():
    made = runs.scene_of("/a/estate.usdc,camera=/World/Cam,frame=3")
    assert made == runs.Scene("estate", pathlib.Path("/a/estate.usdc"), "/World/Cam", "3")
    with pytest.raises(ValueError, match="neither camera=PATH nor frame=TIME"):
        runs.scene_of("a.usda,shutter=1")


@pytest.mark.parametrize("name", bench.SETS)
def test_sets_are_complete_and_the_same_twice(name, tmp_path):
    """Every file is there, every bound material has a surface, the camera is the one that usdrecord takes by itself."""
    from pxr import Sdf, Usd, UsdGeom, UsdShade, UsdUtils

    build = importlib.import_module(f"sets.{name}").build
    made = [build(tmp_path / folder, seed, 0.002, 8) for folder, seed in (("a", 2), ("b", 2), ("c", 4))]
    files = [
        {path.relative_to(root.parent): path.read_bytes() for path in sorted(root.parent.rglob("*.*"))} for root in made
    ]
    assert files[0] == files[1], "same arguments, same files"
    assert files[0] != files[2], "another seed, another set"
    _, _, missing = UsdUtils.ComputeAllDependencies(Sdf.AssetPath(str(made[0])))
    assert [path for path in missing if "<UDIM>" not in path] == []
    stage = Usd.Stage.Open(str(made[0]))
    cameras = [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Camera)]
    assert [prim.GetName() for prim in cameras] == [UsdUtils.GetPrimaryCameraName()]
    groups = [prim for prim in Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()) if not prim.GetTypeName()]
    assert groups == [], "importers lose what is below a prim without a type"
    shapes = [prim for prim in Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()) if prim.IsA(UsdGeom.Gprim)]
    assert len(shapes) > 10
    for prim in shapes:
        material, relation = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        is_bound = not relation or any(
            material.ComputeSurfaceSource(context)[0] for context in (UsdShade.Tokens.universalRenderContext, "mtlx")
        )
        assert is_bound, f"{prim.GetPath()} has a material without a surface"


@pytest.mark.parametrize("is_there", [True, False])
def test_a_set_that_cannot_be_made_is_left_out(tmp_path, capfd, is_there):
    broken = tmp_path / "python"
    if is_there:
        broken.write_text("#!/bin/sh\nexit 4\n")
        broken.chmod(0o755)
    words = ["--sets", "city", "--work", str(tmp_path), "--python", str(broken), "--scene", "a.usda"]
    made = bench.scenes_of(bench.make_parser().parse_args(words))
    assert made == [runs.Scene("a", pathlib.Path("a.usda"))]
    assert "city: not made" in capfd.readouterr().err
    assert not list(tmp_path.rglob("made.txt")), "it is tried again the next time"


def test_a_set_is_rendered_by_the_real_usdrecord(tmp_path, monkeypatch, capsys):
    """One render without a budget, of the smallest city there is."""
    out = tmp_path / "out.json"
    words = ["measure_sets.py", "--sets", "city", "--seed", "2", "--size", "0.001", "--texture", "8", "--width", "16"]
    words += ["--samples", "1", "--percents", "", "--caches", "cold", "--work", str(tmp_path), "--json", str(out)]
    monkeypatch.setattr(sys, "argv", words)
    assert bench.main() == 0, capsys.readouterr()
    (row,) = json.loads(out.read_text())["rows"]
    assert (row["scene"], row["status"], row["same"], row["in_core"]) == ("city", "ok", True, True)
    assert row["rays"] > 16 * 9 and row["device_peak"] > 1 << 20 and row["host_peak"] > 1 << 24
    assert os.path.isdir(tmp_path / "sets")
