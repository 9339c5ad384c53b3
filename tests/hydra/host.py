# SPDX-License-Identifier: Apache-2.0
"""The tests' end of a rendering process: starts host_process.py in the wheel host, sends it commands, survives its
death.

The wheel host and usd-core never share a process: tests author and reckon with usd-core, and look at pictures that
another process made.
"""

from __future__ import annotations

import dataclasses
import json
import os
import pathlib
import select
import subprocess

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent


class HostError(Exception):
    """The command failed inside the host; `log` is what the host wrote meanwhile."""

    def __init__(self, message: str, log: str) -> None:
        super().__init__(f"{message}\n{log}")
        self.log = log


class HostDied(HostError):
    """The process ended or hung: the worst a renderer can do to its host."""


@dataclasses.dataclass
class Picture:
    """One finished render: arrays by AOV, row 0 at the bottom."""

    arrays: dict[str, np.ndarray]
    buffers: dict[str, dict]
    seconds: float
    log: str

    def __getitem__(self, aov: str) -> np.ndarray:
        return self.arrays[aov]


class Host:
    """One rendering process. `scene_index` selects Hydra's new front end; `environment` adds variables."""

    def __init__(
        self, folder: pathlib.Path, scene_index: bool = False, environment: dict[str, str] | None = None
    ) -> None:
        variables = dict(os.environ)
        for name in ("OOCPT_HOST_PYTHON", "PXR_PLUGINPATH_NAME"):
            if not variables.get(name):
                raise RuntimeError(
                    f"{name} is not set: run the tests by `cargo xtask test`, or after eval \"$(cargo xtask env)\""
                )
        variables["USDIMAGINGGL_ENGINE_ENABLE_SCENE_INDEX"] = "1" if scene_index else "0"
        # The canary: any message of the Vulkan validation layer becomes an error of the render.
        variables["OOCPT_VALIDATION"] = "1"
        # Tests compare with closed forms and other renderers at pixel centres.
        variables["OOCPT_FILTER_AOVS"] = "false"
        variables.pop("PYTHONPATH", None)
        variables.update(environment or {})
        self.scene_index, self._folder = scene_index, folder
        self._process = subprocess.Popen(
            [variables["OOCPT_HOST_PYTHON"], str(HERE / "host_process.py"), str(folder)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=variables,
            start_new_session=True,
        )  # fmt: skip
        self._buffer = b""
        self.log = ""

    @property
    def alive(self) -> bool:
        return self._process.poll() is None

    @property
    def pid(self) -> int:
        return self._process.pid

    def call(self, command: str, patience: float = 180.0, **arguments):
        """Runs a command; its result. Raises HostError with the reason, or HostDied."""
        line = json.dumps({"command": command, **arguments}) + "\n"
        try:
            self._process.stdin.write(line.encode())
            self._process.stdin.flush()
            answer = json.loads(self._line(patience))
        except (BrokenPipeError, EOFError):
            status = self._process.wait()
            raise HostDied(f"the host died in `{command}`, status {status}", self.log) from None
        except TimeoutError:
            self._process.kill()
            self._process.wait()
            raise HostDied(f"the host did not answer `{command}` in {patience} s", self.log) from None
        self.log = answer["log"]
        if "error" in answer:
            raise HostError(f"{command}: {answer['error']}\n{answer['trace']}", self.log)
        return answer["result"]

    def _line(self, patience: float) -> bytes:
        while b"\n" not in self._buffer:
            ready, _, _ = select.select([self._process.stdout], [], [], patience)
            if not ready:
                raise TimeoutError
            piece = os.read(self._process.stdout.fileno(), 1 << 16)
            if not piece:
                raise EOFError
            self._buffer += piece
        line, _, self._buffer = self._buffer.partition(b"\n")
        return line

    def open(self, stage, size=(32, 32), **arguments) -> "View":
        """A live view of a stage: a path, the text of a layer, or a usd-core stage."""
        if not isinstance(stage, (str, pathlib.Path)):
            stage = stage.GetRootLayer().ExportToString()
        view = View(self, f"v{id(object())}-{np.random.default_rng().integers(1 << 60)}")
        self.call("open", viewer=view.name, stage=str(stage), size=list(size), **arguments)
        view.pending_log = self.log
        return view

    def picture(self, stage, size=(32, 32), timeout=300.0, **arguments) -> Picture:
        """Opens, renders once, closes."""
        with self.open(stage, size, **arguments) as view:
            return view.render(timeout)

    def close(self) -> None:
        """Ends the process in good order; its exit status must be 0."""
        if not self.alive:
            return
        self._process.stdin.close()
        try:
            status = self._process.wait(timeout=30)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            raise HostDied("the host hangs on exit", self.log) from None
        if status != 0:
            raise HostDied(f"the host ended with status {status}", self.log)


class View:
    """A stage in a live engine of a host."""

    def __init__(self, host: Host, name: str) -> None:
        self.host, self.name = host, name
        # What was written since the last picture; goes to the next one.
        self.pending_log = ""

    def __enter__(self) -> "View":
        return self

    def __exit__(self, *_) -> None:
        if self.host.alive:
            self.host.call("close", viewer=self.name)

    def render(self, timeout: float = 300.0) -> Picture:
        answer = self.host.call("render", viewer=self.name, timeout=timeout, patience=timeout + 60.0)
        with np.load(answer["file"]) as arrays:
            picture = Picture(
                {name: arrays[name] for name in arrays.files}, answer["buffers"], answer["seconds"],
                self.pending_log + self.host.log,
            )
        os.unlink(answer["file"])
        self.pending_log = ""
        return picture

    def edit(self, code: str):
        """Runs statements in the host with `stage`, `engine` and pxr's modules; the value they leave in `result`."""
        result = self.host.call("edit", viewer=self.name, code=code)
        self.pending_log += self.host.log
        return result

    def decode(self, pairs) -> list[dict | None]:
        return self.host.call("decode", viewer=self.name, pairs=[[int(a), int(b)] for a, b in pairs])

    def stats(self) -> dict:
        return self.host.call("stats", viewer=self.name)
