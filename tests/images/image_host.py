# SPDX-License-Identifier: Apache-2.0
"""The process that reads images as the renderer has them read, and writers of the files that it is given."""

from __future__ import annotations

import json
import os
import pathlib
import struct
import subprocess
import zlib

import numpy as np
import OpenEXR

HERE = pathlib.Path(__file__).resolve().parent
TYPES = {0: np.uint8, 1: np.float16, 2: np.float32}
WIDTH, HEIGHT = 50, 40


class Reader:
    """The reading process."""

    def __init__(self, build: pathlib.Path, own: pathlib.Path, limit: int = 0) -> None:
        command = [
            os.environ["OOCPT_HOST_PYTHON"], "-I", HERE / "reader.py", build / "plugin/liboocpt_images_probe.so", own,
            str(limit),
        ]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def ask(self, function: str, *arguments) -> dict:
        self._process.stdin.write(
            json.dumps([f"oocpt_image_{function}", *[str(a) if isinstance(a, pathlib.Path) else a for a in arguments]])
            + "\n"
        )
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        assert line, f"the host died of {function}{arguments}, status {self._process.wait()}"
        answer = json.loads(line)
        assert "host" not in answer, answer["host"]
        return answer

    def facts(self, path) -> dict:
        answer = self.ask("facts", path)
        assert "error" not in answer, answer
        return answer

    def texels(self, path, level=0, at=(0, 0), size=None) -> np.ndarray:
        """Rows from the top, as arrays have them."""
        facts = self.facts(path)
        width, height = size or facts["levels"][level]
        answer = self.ask("read", path, level, *at, width, height)
        assert "error" not in answer, answer
        texels = np.frombuffer(bytes.fromhex(answer["texels"]), TYPES[facts["format"]])
        return texels.reshape(height, width, facts["channels"])[::-1]

    def decoded(self, path, level=0) -> np.ndarray:
        """The level decoded at once; rows from the top."""
        facts = self.facts(path)
        width, height = facts["levels"][level]
        answer = self.ask("decode", path, level, 0)
        assert "error" not in answer, answer
        return np.frombuffer(bytes.fromhex(answer["texels"]), TYPES[facts["format"]]).reshape(
            height, width, facts["channels"]
        )

    def close(self) -> None:
        self._process.stdin.close()
        assert self._process.wait(timeout=30) == 0, "the host ends in good order"


def noise(shape, kind) -> np.ndarray:
    random = np.random.default_rng(7).random(shape)
    return (
        (random * 255).astype(kind)
        if kind == np.uint8
        else (random * 65535).astype(kind) if kind == np.uint16 else random.astype(kind)
    )


def write_exr(path: pathlib.Path, texels: np.ndarray, **header) -> None:
    channels = {
        "RGBA"[i] if texels.shape[2] > 1 else "Y": np.ascontiguousarray(texels[:, :, i]) for i in range(texels.shape[2])
    }
    part = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION} | header
    OpenEXR.File(part, channels).write(str(path))


def write_png16(path: pathlib.Path, texels: np.ndarray, chunks=()) -> None:
    """A PNG of 16 bits, three channels; Pillow writes none."""

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    height, width, _ = texels.shape
    rows = b"".join(b"\0" + row.astype(">u2").tobytes() for row in texels)
    middle = b"".join(chunk(*each) for each in chunks)
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 16, 2, 0, 0, 0))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + head + middle + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))
