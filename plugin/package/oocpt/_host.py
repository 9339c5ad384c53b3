# SPDX-License-Identifier: Apache-2.0
"""Where the package's programs run: a process of this interpreter with the OpenUSD inside the package `bpy`, which is
looked for but never imported here."""

from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Iterable
from pathlib import Path

from oocpt import _pins

PACKAGE = Path(__file__).resolve().parent
COMMAND = PACKAGE / "bin/oocpt"
_SITE = f"{_pins.BPY.rpartition('.')[0]}/python/lib/python{_pins.PYTHON}/site-packages"
_NO_HOST = (
    f"the package bpy {_pins.BPY}, whose OpenUSD renders, is not installed for this Python: "
    f"pip install bpy=={_pins.BPY} (Python {_pins.PYTHON})"
)


class RenderError(RuntimeError):
    """A picture was not made. The text is what the renderer or the host said of it."""


def bpy() -> Path:
    """The folder of the host.

    Raises:
        RenderError: it is not installed, or another version is.
    """
    found = importlib.util.find_spec("bpy")
    for place in (found and found.submodule_search_locations) or ():
        if Path(place, "lib/libusd_ms.so").is_file() and Path(place, _SITE, "pxr").is_dir():
            return Path(place)
    raise RenderError(_NO_HOST)


def environment() -> dict[str, str]:
    """Variables of a process that renders: the user's, and where the plugin, the host and our programs are."""
    host = bpy()
    numpy = importlib.util.find_spec("numpy")
    if numpy is None or numpy.origin is None:
        raise RenderError("the package numpy is not installed for this Python: pip install numpy")
    variables = dict(os.environ)
    _prepend(variables, "PATH", PACKAGE / "bin")
    _prepend(variables, "PXR_PLUGINPATH_NAME", PACKAGE / "plugin/hdOocPT/resources")
    if not variables.get("PXR_MTLX_STDLIB_SEARCH_PATHS"):
        variables["PXR_MTLX_STDLIB_SEARCH_PATHS"] = str(host / "lib/materialx/libraries")
    variables["OOCPT_HOST_PYTHON"] = sys.executable
    variables["OOCPT_HOST_MODULES"] = os.pathsep.join([str(host / _SITE), str(Path(numpy.origin).parents[1])])
    return variables


def command(program: str, arguments: Iterable[str | os.PathLike[str]] = ()) -> list[str]:
    """The command line of one of the programs of `_run.py`. Isolated (-I): a PYTHONPATH that leads to another OpenUSD
    must not get into that process."""
    if not sys.executable:
        raise RenderError("there is no Python program to start: this interpreter is part of another one")
    return [sys.executable, "-I", str(PACKAGE / "_run.py"), program, *(os.fspath(word) for word in arguments)]


def _prepend(variables: dict[str, str], name: str, folder: Path) -> None:
    old = variables.get(name)
    variables[name] = f"{folder}{os.pathsep}{old}" if old else str(folder)
