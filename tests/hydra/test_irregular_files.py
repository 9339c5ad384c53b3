# SPDX-License-Identifier: Apache-2.0
"""What is no regular file, wherever a file is named: refused with the reason, in bounded time, and left as it is."""

from __future__ import annotations

import os
import pathlib
import socket
import subprocess

import pytest

SCENE = """#usda 1.0
(
    upAxis = "Y"
)
def Camera "Cam" {
    token projection = "orthographic"
    float horizontalAperture = 10
    float verticalAperture = 10
    double3 xformOp:translate = (0.5, 0.5, 20)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Mesh "Card" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    rel material:binding = </Material>
}
def Material "Material" {
    token outputs:surface.connect = </Material/Surface.outputs:surface>
    def Shader "Surface" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </Material/Picture.outputs:rgb>
        color3f inputs:emissiveColor.connect = </Material/Faces.outputs:rgb>
        token outputs:surface
    }
    def Shader "Picture" {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @FOLDER/picture.png@
        color3f outputs:rgb
    }
    def Shader "Faces" {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @FOLDER/faces.ptx@
        color3f outputs:rgb
    }
}
def SphereLight "Lamp" (prepend apiSchemas = ["ShapingAPI"]) {
    asset inputs:shaping:ies:file = @FOLDER/profile.ies@
}
def DomeLight "Sky" {
    asset inputs:texture:file = @FOLDER/sky.exr@
}
"""
FILES = ["picture.png", "faces.ptx", "profile.ies", "sky.exr", "error.jsonl", "materials.json"]


def make(kind: str, path: pathlib.Path):
    """Puts a thing of that kind at the path; what has to stay open."""
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        # What several names lead to is told once.
        path.symlink_to("/dev/urandom" if path.suffix == ".ptx" else "/dev/zero")
    elif kind == "folder":
        path.mkdir()
    elif kind == "socket":
        listener = socket.socket(socket.AF_UNIX)
        listener.bind(str(path))
        return listener
    return None


@pytest.mark.parametrize(
    "kind, scene_index", [("pipe", "0"), ("pipe", "1"), ("device", "0"), ("folder", "1"), ("socket", "0")]
)
def test_irregular_files_in_scenes_and_settings_are_refused(tmp_path, kind, scene_index):
    held = [make(kind, tmp_path / name) for name in FILES]
    scene, out = tmp_path / "scene.usda", tmp_path / "out.exr"
    scene.write_text(SCENE.replace("FOLDER", str(tmp_path)))
    variables = dict(
        os.environ, USDIMAGINGGL_ENGINE_ENABLE_SCENE_INDEX=scene_index, OOCPT_SAMPLES_PER_PIXEL="1",
        OOCPT_REPORT=str(tmp_path / "error.jsonl"), OOCPT_MATERIAL_REPORT=str(tmp_path / "materials.json"),
    )  # fmt: skip
    variables.pop("PYTHONPATH", None)
    command = ["usdrecord", "--renderer", "OocPT", "--disableCameraLight", "--imageWidth", "8", "--camera", "/Cam"]
    done = subprocess.run(
        [*command, str(scene), str(out)],
        env=variables, capture_output=True, text=True, timeout=60, check=False, start_new_session=True,
    )  # fmt: skip
    assert done.returncode == 0 and out.exists(), done.stderr
    for name in FILES:
        lines = [line for line in done.stderr.splitlines() if name in line]
        assert any(kind in line and "not a file" in line for line in lines), (name, done.stderr)
        assert not (tmp_path / name).is_file(), name
    for listener in filter(None, held):
        listener.close()


@pytest.mark.parametrize("kind", ["pipe", "device", "folder"])
def test_an_irregular_reference_of_a_report_is_refused(tmp_path, kind):
    """It is read where there is a report to compare with it."""
    make(kind, tmp_path / "reference.exr")
    scene = tmp_path / "scene.usda"
    scene.write_text(SCENE.split("def Mesh")[0])
    variables = dict(
        os.environ, OOCPT_SAMPLES_PER_PIXEL="1", OOCPT_REPORT=str(tmp_path / "report.jsonl"),
        OOCPT_REFERENCE=str(tmp_path / "reference.exr"),
    )  # fmt: skip
    variables.pop("PYTHONPATH", None)
    command = ["usdrecord", "--renderer", "OocPT", "--disableCameraLight", "--imageWidth", "8", "--camera", "/Cam"]
    done = subprocess.run(
        [*command, str(scene), str(tmp_path / "out.exr")],
        env=variables, capture_output=True, text=True, timeout=60, check=False, start_new_session=True,
    )  # fmt: skip
    assert done.returncode == 0 and (tmp_path / "report.jsonl").exists(), done.stderr
    assert "reference.exr" in done.stderr and kind in done.stderr, done.stderr
