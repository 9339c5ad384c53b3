# SPDX-License-Identifier: Apache-2.0
"""Pixel conversion between the renderer's formats and those that hosts ask for; the checks are in pixels.cpp."""

import os
import pathlib
import subprocess

CODE = (
    "import ctypes, sys; from pxr import Tf; f = ctypes.CDLL(sys.argv[1]).oocpt_pixels_run; "
    "f.restype = ctypes.c_char_p; sys.stdout.write(f().decode())"
)


def test_pixels():
    for name in ("OOCPT_BUILD", "OOCPT_HOST_PYTHON"):
        assert os.environ.get(name), f"{name} is not set: run the tests by `cargo xtask test`"
    build = pathlib.Path(os.environ["OOCPT_BUILD"])
    subprocess.run(["cmake", "--build", str(build), "--target", "oocpt_pixels"], check=True)
    library = build / "abi/liboocpt_pixels.so"
    done = subprocess.run([os.environ["OOCPT_HOST_PYTHON"], "-I", "-c", CODE, library], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
