# SPDX-License-Identifier: Apache-2.0
"""The bench of live hosts: its order, its words, and one real run."""

from __future__ import annotations

import json
import pathlib
import sys

import pytest

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import measure_live as bench  # noqa: E402
from usdrecord_runs import Scene  # noqa: E402


def row(move: str, first: float | None, emptiest: float = 0.0, count: int = 4) -> dict:
    times = {"count": count, "median": first, "p99": first}
    return {
        "scene": "s", "move": move, "moves": 4, "meshesMade": 0, "held": times, "first": times, "full": times,
        "emptiest": emptiest, "shown": 4, "device": None, "host": 1 << 20,
    }  # fmt: skip


def test_the_worst_row_is_first():
    start = {"scene": "s", "move": "start", "held": 1.0, "first": 1.0, "converged": None, "device": 0, "host": 0}
    fast, slow, never, holes = row("a", 0.01), row("b", 0.2), row("c", None, count=0), row("d", 0.001, 0.25)
    assert bench.worst_first([start, fast, slow, never, holes]) == [holes, never, slow, fast, start]
    assert "never" in bench.line(never) and "0/4" in bench.line(never) and "0.25" in bench.line(holes)
    assert "never" in bench.line(start), "it did not converge"


def arguments(tmp_path, **changes):
    parsed = bench.make_parser().parse_args(["--width", "32", "--height", "18", "--samples", "2", "--moves", "2"])
    vars(parsed).update(work=tmp_path, **changes)
    return parsed


def test_a_scene_that_cannot_be_opened_says_why(tmp_path):
    rows, failed = bench.measure(Scene("none", tmp_path / "none.usda"), arguments(tmp_path))
    assert rows == [] and "none.usda" in failed
    rows, failed = bench.measure(Scene("none", tmp_path / "none.usda"), arguments(tmp_path, host=str(tmp_path / "no")))
    assert rows == [] and failed, "nor a host that is not there"


@pytest.mark.parametrize(("name", "side"), [("creature", "6"), ("terrain", "16")])
def test_a_scene_is_looked_at_in_a_real_host(name, side, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(bench, "MADE", {name: [f"{name}.py", "--side", side]})
    made = tmp_path / "live.json"
    words = ["measure_live.py", "--scenes", name, "--width", "48", "--height", "27", "--samples", "2"]
    monkeypatch.setattr(sys, "argv", [*words, "--moves", "2", "--work", str(tmp_path), "--json", str(made)])
    assert bench.main() == 0, capsys.readouterr().out
    rows = {row["move"]: row for row in json.loads(made.read_text())["rows"]}
    assert list(rows) == [
        "start", "tumble", "tumble, 30 a second", "zoom", "walk", "walk, 30 a second", "light", "instance",
    ]  # fmt: skip
    for name in ("tumble", "zoom", "walk", "light", "instance"):
        assert rows[name]["full"]["count"] == 2, f"{name}: each step has its picture"
        assert rows[name]["emptiest"] == 0, f"{name}: whole"
    assert rows["light"]["meshesMade"] == 0, "a light builds nothing"


@pytest.mark.parametrize("text", ["wood", "creature,wood"])
def test_unknown_scenes_are_refused(text, capsys):
    with pytest.raises(SystemExit):
        bench.make_parser().parse_args(["--scenes", text])
    assert "wood is none of" in capsys.readouterr().err
