# SPDX-License-Identifier: Apache-2.0
"""`oocpt film`: parts that hosts render in different ways merge to the bits and the error of the whole."""

import json
import os
import subprocess

import OpenEXR
import pytest

import compare
import exr
import small

SCENE = small.FOLDER / "nested.usda"
WAYS = [
    {"OOCPT_TRAVERSAL": "compute"}, {"OOCPT_TRAVERSAL": "native"},
    {"OOCPT_TRAVERSAL": "compute", "OOCPT_CHUNK_REPORT": "report.json"},
]  # fmt: skip
CUTS = [(13,), (5, 13), (1, 8, 13)]


@pytest.fixture
def film(tmp_path):
    """Runs a command of `oocpt film`; the finished process."""

    def run(*words, status=0, **environment):
        variables = dict(os.environ, OOCPT_MAX_BOUNCES="2") | environment
        variables.pop("PYTHONPATH", None)
        line = [os.environ["OOCPT_CLI"], "film", *map(str, words)]
        done = subprocess.run(
            line, env=variables, cwd=tmp_path, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=300,
            check=False,
        )  # fmt: skip
        assert done.returncode == status, done.stderr
        return done

    return run


def part(film, name, begin, end, *words, **environment):
    return film(
        "render", SCENE, "--camera", "/World/Camera", "--width", 48, "--samples", f"{begin}..{end}", "--out", name,
        *words, "--", "--disableCameraLight", **environment,
    )  # fmt: skip


def told(path):
    with OpenEXR.File(str(path)) as file:
        header = {name: value for name, value in file.header().items() if name.startswith("oocpt:error")}
        return {name: float(value[0]) for name, value in header.items()}


def test_parts_merge_to_the_bits_of_the_whole(film, tmp_path):
    pictures = []
    for cuts in CUTS:
        names = []
        for begin, end, way in zip((0, *cuts), cuts, WAYS):
            names.append(f"part{len(cuts)}.{begin}")
            part(film, names[-1], begin, end, **way)
        film("merge", *reversed(names), "--out", f"film{len(cuts)}")
        pictures.append(tmp_path / f"picture{len(cuts)}.exr")
        film("picture", f"film{len(cuts)}", "--out", pictures[-1])
    whole = exr.read(pictures[0])
    assert whole[..., 3].max() > 0.9 and "oocpt:errorEstimate" in told(pictures[0])
    for picture in pictures[1:]:
        compare.same_bits(exr.read(picture), whole, picture.name)
        assert told(picture) == told(pictures[0]), "the error too"
    facts = [json.loads(line) for line in film("info", "part3.1", "part3.8", "--json").stdout.splitlines()]
    assert [one["samples"] for one in facts[:2]] == [[{"begin": 1, "end": 8}], [{"begin": 8, "end": 13}]], facts


def test_parts_with_the_light_at_the_camera_merge(film):
    """Each process names that light by an address of its own."""
    for begin, end in ((0, 2), (2, 4)):
        film(
            "render", SCENE, "--camera", "/World/Camera", "--width", 48, "--samples", f"{begin}..{end}",
            "--out", f"lit{begin}",
        )  # fmt: skip
    film("picture", "lit0", "lit2", "--out", "picture.exr")


def test_parts_of_another_scene_or_with_holes_are_refused(film, tmp_path):
    part(film, "a", 0, 2)
    part(film, "b", 4, 6)
    said = film("picture", "a", "b", "--out", "picture.exr", status=1).stderr
    assert "2..4" in said, said
    part(film, "c", 2, 4, "--set", "seed=3")
    said = film("merge", "a", "c", "--out", "film", status=1).stderr
    assert "oocpt:seed: 3 and 0" in said and not (tmp_path / "film").exists(), said
    assert "oocpt:samplesPerPixel" not in said, "what samples do not depend on"
    adaptive = film("render", SCENE, "--samples", "0..4", "--out", "d", "--set", "adaptiveSampling=true", status=1)
    said = adaptive.stderr
    assert "do not merge" in said and not (tmp_path / "d").exists(), said
