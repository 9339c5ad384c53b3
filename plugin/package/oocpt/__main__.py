# SPDX-License-Identifier: Apache-2.0
"""The command `oocpt`: `oocpt record [usdrecord's flags] SCENE PICTURE`; everything else is done by the program of that
name (`oocpt doctor` lists the devices). Both replace this process, so they get its signals and give its exit status."""

from __future__ import annotations

import os
import sys

from oocpt._host import COMMAND, RenderError, command, environment

_HELP = """\
In this package there is also
  record    Renders a USD file: oocpt record [FLAGS] SCENE PICTURE; oocpt record --help lists the flags
"""


def main() -> int:
    arguments = sys.argv[1:]
    if arguments in ([], ["--help"], ["-h"], ["help"]):
        print(_HELP, flush=True)
    try:
        if arguments[:1] == ["record"]:
            words, variables = command("usdrecord", arguments[1:]), environment()
            os.execve(words[0], words, variables)
        # The lists of devices and reports need no host.
        os.execve(COMMAND, ["oocpt", *arguments], _environment_if_there())
    except RenderError as error:
        print(f"oocpt: {error}", file=sys.stderr)
    except OSError as error:
        print(f"oocpt: cannot be started: {error}", file=sys.stderr)
    return 1


def _environment_if_there() -> dict[str, str]:
    try:
        return environment()
    except RenderError:
        return dict(os.environ)


if __name__ == "__main__":
    sys.exit(main())
