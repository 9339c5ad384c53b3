# SPDX-License-Identifier: Apache-2.0
"""The process that renders: `python -I _run.py usdrecord|texture-host|render ARGUMENTS`, with the variables that
`_host.environment` sets. Makes `pxr` of the host importable, and runs one program."""

import ctypes
import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
PROGRAMS = {"usdrecord": "_usdrecord.py", "texture-host": "_texture_host.py", "render": "_render_process.py"}


def load_missing_libraries():
    """Loads what the host's OpenUSD is linked to (OpenGL's and X11's client libraries, which it does not call here)
    from the package, where the machine has none. A name that is loaded is not searched for again."""
    folder = os.path.join(HERE, "lib")
    missing = set(os.listdir(folder))
    loaded = True
    while missing and loaded:  # one may need another
        loaded = {name for name in sorted(missing) if is_loaded(name) or is_loaded(os.path.join(folder, name))}
        missing -= loaded


def is_loaded(library):
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def main():
    program = PROGRAMS[sys.argv[1]]
    # Before site-packages, which may hold another OpenUSD; numpy after it, should it be there, too.
    host, numpy = os.environ["OOCPT_HOST_MODULES"].split(os.pathsep)
    sys.path.insert(0, host)
    sys.path += [numpy, HERE]
    load_missing_libraries()
    path = os.path.join(HERE, program)
    # The program's name in its help.
    sys.argv = ["oocpt record" if sys.argv[1] == "usdrecord" else sys.argv[1], *sys.argv[2:]]
    with open(path, "rb") as source:
        code = compile(source.read(), path, "exec")
    exec(code, {"__name__": "__main__", "__file__": path})  # noqa: S102  a file of the package


if __name__ == "__main__":
    main()
