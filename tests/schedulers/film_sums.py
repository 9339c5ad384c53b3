# SPDX-License-Identifier: Apache-2.0
"""What of film files and their pictures has to be the same however samples were cut: sums and errors, without times and
devices. Reads the format as the book's page on films describes it."""

from __future__ import annotations

import pathlib
import struct

import OpenEXR


def sums(film: pathlib.Path) -> bytes:
    """The packed chunks of all blocks."""
    data = film.read_bytes()
    assert data[:8] == b"OOCPTFLM", film
    at = 32 + struct.unpack_from("<I", data, 12)[0]
    kept = []
    while True:
        name, chunked, _, _, _, _ = struct.unpack_from("<16sQQIIQ", data, at)
        at += 48
        if name.rstrip(b"\0") == b"end":
            return b"".join(kept)
        end = at + chunked
        while at < end:
            packed = struct.unpack_from("<I", data, at + 4)[0]
            kept.append(name + data[at + 16 : at + 16 + packed])
            at += 16 + packed
        assert at == end, film


def errors(picture: pathlib.Path) -> dict[str, float]:
    """What a picture says of its error and its samples."""
    with OpenEXR.File(str(picture)) as file:
        header = file.header()
    told = {name: value for name, value in header.items() if name.startswith(("oocpt:error", "oocpt:samples"))}
    return {name: str(value) for name, value in told.items()}
