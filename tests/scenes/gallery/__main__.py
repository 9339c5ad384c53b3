# SPDX-License-Identifier: Apache-2.0
"""Writes the gallery's scenes; see the package."""

import argparse
import pathlib
import sys

from . import NAMES, write


def main() -> None:
    parser = argparse.ArgumentParser(prog="gallery")
    parser.add_argument("out", type=pathlib.Path, help="folder to write to; each scene gets one below it")
    parser.add_argument("--only", action="append", choices=NAMES, help="this scene; may be given more than once")
    parser.add_argument(
        "--set", action="append", default=[], metavar="NAME.OPTION=VALUE",
        help="an option of a scene, for example woods.kinds=64",
    )
    arguments = parser.parse_args()
    options: dict[str, dict] = {}
    for text in arguments.set:
        key, _, value = text.partition("=")
        name, _, option = key.partition(".")
        if name not in NAMES or not option or not value:
            parser.error(f"--set {text}: not NAME.OPTION=VALUE")
        options.setdefault(name, {})[option] = int(value)
    for name in arguments.only or NAMES:
        print(write(name, arguments.out, options.get(name)), file=sys.stderr)


if __name__ == "__main__":
    main()
