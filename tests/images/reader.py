# SPDX-License-Identifier: Apache-2.0
"""The program that reads images in the wheel host: one JSON request a line, [function, argument..], one JSON answer a
line.

The host's own OpenImageIO and OpenEXR read an image before the library of image readers is loaded and another after
each request, as an application would; what they say must stay the same.
"""

from __future__ import annotations

import ctypes
import json
import resource
import sys

import OpenImageIO as oiio
from pxr import Ar, Usd, UsdImagingGL  # noqa: F401  the host, loaded whole


def own_reading(path: str) -> list[float]:
    return oiio.ImageBuf(path).get_pixels(oiio.FLOAT).ravel().tolist()


def main(library: str, own: str, limit: str) -> None:
    before = own_reading(own)
    if int(limit):
        # Bytes of addresses: what is asked for beyond is refused, and who does not expect that dies.
        resource.setrlimit(resource.RLIMIT_AS, (int(limit), int(limit)))
    probe = ctypes.CDLL(library)
    for line in sys.stdin:
        name, *arguments = json.loads(line)
        function = getattr(probe, name)
        function.restype = ctypes.c_char_p
        answer = json.loads(
            function(*[argument.encode() if isinstance(argument, str) else argument for argument in arguments]).decode(
                errors="replace"
            )
        )
        if own_reading(own) != before:
            answer["host"] = "the host's own OpenImageIO reads another image than before"
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
