# SPDX-License-Identifier: Apache-2.0
"""One real usdrecord in a process of its own: what it took, what the renderer reports, what became of the picture.

Nothing but Python's own library, so that it runs wherever a usdrecord does.
"""

from __future__ import annotations

import hashlib
import json
import os
import pathlib
import re
import shutil
import signal
import struct
import subprocess
import tempfile
import time
from dataclasses import dataclass, field

MIB = 1 << 20
MAX_LOG_BYTES = 1 << 20
MAX_REPORT_BYTES = 64 << 20
MESSAGES = 4


@dataclass(frozen=True)
class Scene:
    """A file, and what usdrecord is told of it."""

    name: str
    file: pathlib.Path
    camera: str = ""
    frame: str = ""


def scene_of(text: str) -> Scene:
    """`FILE[,camera=PATH][,frame=TIME]`."""
    file, *options = text.split(",")
    given = {}
    for option in options:
        key, _, value = option.partition("=")
        if key not in ("camera", "frame") or not value:
            raise ValueError(f"{text}: {option} is neither camera=PATH nor frame=TIME")
        given[key] = value
    return Scene(pathlib.Path(file).stem, pathlib.Path(file), **given)


@dataclass
class Host:
    """A usdrecord and how it is run."""

    command: list[str]
    work: pathlib.Path
    width: int
    samples: int
    limit: float
    bounces: int | None = None
    device: str = ""

    def caches(self) -> pathlib.Path:
        """Of geometry and textures; those of compiled passes are the user's own, which `compile` fills."""
        return self.work / "caches"


@dataclass
class Run:
    """One process."""

    status: str = "ok"
    secs: float = 0.0
    cpu_secs: float = 0.0
    host_peak: int = 0
    pixels: str = ""
    report: dict = field(default_factory=dict)
    messages: list[str] = field(default_factory=list)

    @property
    def is_good(self) -> bool:
        return self.status == "ok"


def record(
    host: Host, scene: Scene, budget_mib: int, is_cold: bool, samples: int | None = None, seed: int = 0,
    keep: pathlib.Path | None = None,
) -> Run:  # fmt: skip
    """Renders once; never raises for what the process does. The picture is kept at `keep`."""
    if is_cold:
        shutil.rmtree(host.caches(), ignore_errors=True)
    for kind in ("geometry", "textures"):
        (host.caches() / kind).mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="run-", dir=host.work) as folder:
        place = pathlib.Path(folder)
        out = place / ("picture.###.exr" if scene.frame else "picture.exr")
        command = [*host.command, "--renderer", "OocPT", "--imageWidth", str(host.width)]
        command += ["--disableCameraLight", "--enableDomeLightVisibility"]
        command += ["--camera", scene.camera] if scene.camera else []
        command += ["--frames", scene.frame] if scene.frame else []
        environment = _environment(host, place, budget_mib, samples or host.samples) | {"OOCPT_SEED": str(seed)}
        run = watched([*command, str(scene.file), str(out)], environment, host.limit, place)
        pictures = sorted(place.glob("picture*.exr"))
        if run.is_good and not pictures:
            run.status = "no picture"
        if pictures:
            run.pixels = pixels_of(pictures[0])
            if keep:
                shutil.copyfile(pictures[0], keep)
        run.report = report_of(place / "report.jsonl")
    return run


def _environment(host: Host, place: pathlib.Path, budget_mib: int, samples: int) -> dict[str, str]:
    made = {
        **os.environ, "OOCPT_SAMPLES_PER_PIXEL": str(samples), "OOCPT_ENABLE_INTERACTIVE": "false",
        "OOCPT_REPORT": str(place / "report.jsonl"), "OOCPT_MEMORY_BUDGET": str(budget_mib),
        "OOCPT_GEOMETRY_CACHE": str(host.caches() / "geometry"),
        "OOCPT_TEXTURE_CACHE": str(host.caches() / "textures"),
    }  # fmt: skip
    if host.bounces is not None:
        made["OOCPT_MAX_BOUNCES"] = str(host.bounces)
    if host.device:
        made["OOCPT_DEVICE"] = host.device
    return made


def watched(command: list[str], environment: dict[str, str], limit: float, folder: pathlib.Path) -> Run:
    """Runs a command for `limit` seconds at most; then it and all that it started are ended."""
    run, start = Run(), time.monotonic()
    log = folder / "log.txt"
    try:
        with open(log, "wb") as said:
            process = subprocess.Popen(
                command, env=environment, stdin=subprocess.DEVNULL, stdout=said, stderr=said, start_new_session=True
            )
    except OSError as error:
        run.status, run.messages = "not started", [str(error)]
        return run
    code, used = None, None
    while code is None:
        done, status, used = os.wait4(process.pid, os.WNOHANG)
        if done:
            code = os.waitstatus_to_exitcode(status)
        elif time.monotonic() - start > limit:
            os.killpg(process.pid, signal.SIGKILL)
            _, status, used = os.wait4(process.pid, 0)
            code, run.status = os.waitstatus_to_exitcode(status), f"none in {limit:g} s"
        else:
            time.sleep(0.01)
    process.returncode = code
    run.secs, run.cpu_secs = time.monotonic() - start, used.ru_utime + used.ru_stime
    run.host_peak = used.ru_maxrss << 10
    if run.is_good and code != 0:
        run.status = f"exit {code}" if code > 0 else f"signal {-code}"
    run.messages = messages_of(log)
    return run


def messages_of(log: pathlib.Path) -> list[str]:
    """The first lines that warn or tell of an error, and the last line."""
    with open(log, "rb") as said:
        text = said.read(MAX_LOG_BYTES).decode(errors="replace")
    lines = [line.strip()[:400] for line in text.splitlines() if line.strip()]
    bad = [line for line in lines if re.search("warning|error|panic|left out|cannot", line, re.IGNORECASE)]
    return list(dict.fromkeys(bad[:MESSAGES] + bad[-1:]))


def report_of(path: pathlib.Path) -> dict:
    """Header, last row and usage of the last render in a report; empty where there is none. Lines that are no JSON, as
    a crash may leave, are passed over."""
    made: dict = {}
    try:
        with open(path, "rb") as file:
            lines = file.read(MAX_REPORT_BYTES).splitlines()
    except OSError:
        return made
    for line in lines:
        try:
            entry = json.loads(line)
        except ValueError:
            continue
        if not isinstance(entry, dict):
            continue
        if "oocptErrorReport" in entry:
            made = {"device": entry.get("device", "")}
        elif "usage" in entry:
            made["usage"] = entry["usage"] if isinstance(entry["usage"], dict) else {}
        elif "samples" in entry:
            made["row"] = entry
    return made


def pixels_of(path: pathlib.Path) -> str:
    """A hash of an EXR file's pixels: of all behind its header and its table of offsets, which hold how the picture was
    made and so differ from run to run."""
    data = path.read_bytes()
    try:
        data = data[_first_block(data) :]
    except (IndexError, ValueError, struct.error):
        pass
    return hashlib.sha256(data).hexdigest()


def _first_block(data: bytes) -> int:
    if data[:4] != b"\x76\x2f\x31\x01":
        raise ValueError("no OpenEXR file")
    at = 8
    while data[at]:
        at = data.index(b"\0", data.index(b"\0", at) + 1) + 1
        at += 4 + struct.unpack_from("<I", data, at)[0]
    first = struct.unpack_from("<Q", data, at + 1)[0]
    if not at < first < len(data):
        raise ValueError("an offset outside of the file")
    return first
