# SPDX-License-Identifier: Apache-2.0
"""Warnings: few lines where many prims say the like, in every host; in our usdrecord plain lines without the host's
source."""

import os
import re
import subprocess

import pytest
from pxr import Usd

import small

QUICK = {"oocpt:samplesPerPixel": 1, "oocpt:maxBounces": 0}
SUM = r"/World/Proto_00 and 15 more prims: bad data: 4 zero-area triangles \(64 in all\)"


@pytest.fixture
def scene(tmp_path):
    """16 meshes, each a square and four triangles without area, and a reference to a file that is not there."""
    path = tmp_path / "many.usda"
    squares = "".join(
        f'    def Mesh "Proto_{n:02}"\n    {{\n'
        '        uniform token subdivisionScheme = "none"\n'
        "        int[] faceVertexCounts = [4, 3, 3, 3, 3]\n"
        "        int[] faceVertexIndices = [0, 1, 2, 3, 0, 0, 1, 0, 0, 2, 1, 1, 2, 3, 3, 0]\n"
        f"        point3f[] points = [({n}, 0, 0), ({n}.9, 0, 0), ({n}.9, 1, 0), ({n}, 1, 0)]\n    }}\n"
        for n in range(16)
    )
    camera = '    def Camera "Camera"\n    {\n        double3 xformOp:translate = (8, 0, 50)\n' \
        '        uniform token[] xformOpOrder = ["xformOp:translate"]\n    }\n'  # fmt: skip
    gone = '    def "Gone" (references = @no_such_file.usda@)\n    {\n    }\n'
    path.write_text(f'#usda 1.0\ndef "World"\n{{\n{squares}{camera}{gone}}}\n')
    return path


def usdrecord(scene, out, **environment):
    command = ["usdrecord", "--disableGpu", "--camera", "/World/Camera", "--imageWidth", "16", str(scene), str(out)]
    variables = dict(os.environ, OOCPT_SAMPLES_PER_PIXEL="1", **environment)
    variables.pop("PYTHONPATH", None)
    return subprocess.run(
        command, env=variables, capture_output=True, text=True, timeout=120, check=False, start_new_session=True
    )


@pytest.mark.parametrize("front_end", ["0", "1"], ids=["legacy", "scene_index"])
def test_warnings_of_usdrecord_are_plain_lines(scene, tmp_path, front_end):
    done = usdrecord(scene, tmp_path / "out.exr", USDIMAGINGGL_ENGINE_ENABLE_SCENE_INDEX=front_end)
    assert done.returncode == 0, done.stderr
    # USD frames environment variables that it was given in number signs; a render ends with a line of its own.
    lines = [line for line in done.stderr.splitlines() if not re.match(r"#|OocPT: 1 samples, ", line)]
    assert len([line for line in lines if re.fullmatch(f"OocPT: warning: {SUM}", line)]) == 1, lines
    assert len([line for line in lines if line.startswith("USD: warning: ") and "no_such_file" in line]) == 1, lines
    assert all(re.match(r"(OocPT|USD): warning: \S", line) for line in lines), lines
    assert len(lines) == 2 and not re.search(r"at line \d|\.cpp", done.stderr), lines


def test_errors_of_usdrecord_are_plain_lines(scene, tmp_path):
    done = usdrecord(scene, tmp_path / "out.exr", OOCPT_DEVICE="no such device")
    assert done.returncode == 1 and not re.search(r"at line \d|\.cpp", done.stderr), done.stderr
    errors = [line for line in done.stderr.splitlines() if "no such device" in line]
    assert len(errors) == 1 and errors[0].startswith("OocPT: error: "), done.stderr


def test_other_hosts_get_the_summary_through_tf(host, scene):
    with host.open(scene, (16, 16), camera="/World/Camera", settings=QUICK) as view:
        log = view.render().log
    ours = [line for line in log.splitlines() if "/World/Proto" in line]
    assert len(ours) == 1 and re.search(f"in .* at line .* -- OocPT: {SUM}", ours[0]), log


def test_different_warnings_keep_their_own_lines(host):
    with host.open(small.FOLDER / "bad_data.usda", (16, 16), settings=QUICK) as view:
        log = view.render().log
    for name in small.BAD_PRIMS:
        assert f"/World/{name}" in log, f"no warning names {name}:\n{log}"


SPLATS = """
    def ParticleField3DGaussianSplat "Splats"
    {
        point3f[] positions = [(0, 0, 0), (1, 0, 0)]
        quatf[] orientations = [(1, 0, 0, 0), (1, 0, 0, 0)]
        float3[] scales = [(1, 1, 1), (1, 1, 1)]
        float[] opacities = [1, 1]
    }
"""


def test_gaussian_splats_are_left_out_by_name(pool, scene):
    """OpenUSD 25.08 does not know the type, and hands nothing over."""
    scene.write_text(scene.read_text().removesuffix("}\n") + SPLATS + "}\n")
    log = pool.get("scene_index").picture(scene, (16, 16), settings=QUICK).log
    warned = "/World/Splats: a particleField is not supported yet; left out" in log
    assert warned == (Usd.GetVersion() >= (0, 26, 3)), log
