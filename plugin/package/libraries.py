# SPDX-License-Identifier: Apache-2.0
"""Which shared libraries go into the package: those that the readers of images and the host need beyond glibc and GCC's
runtime, from this (Debian-like) machine, under licences that let anybody hand them on.

Debian's OpenImageIO is linked to everything that it can read, video and geodata included: some 250 libraries, several
of them under the GPL. The plugin asks it for seven kinds of files only (cpp/images/imageKind.cpp). So libraries that
are not in LICENCES are not packed; a stand-in of the same soname satisfies the loader. Its functions do nothing and
return the address of an empty string: to the few that are called (versions of libraries, when OpenImageIO lists its
readers) that is an answer, and to a caller that expects 0 for success (libtiff, of a JBIG picture) it is a failure.
"""

from __future__ import annotations

import functools
import re
import subprocess
from collections.abc import Iterable
from pathlib import Path

# What a machine with a C++ runtime has; they are never packed.
SYSTEM = re.compile(r"(libc|libm|libdl|librt|libpthread|libstdc\+\+|libgcc_s|ld-linux-x86-64)\.so\.\d+$|linux-vdso")
# What is packed, by the beginning of its file's name.
LICENCES = {
    "libOpenImageIO": "BSD-3-Clause", "libOpenImageIO_Util": "BSD-3-Clause", "libOpenColorIO": "BSD-3-Clause",
    "libOpenEXR": "BSD-3-Clause", "libOpenEXRCore": "BSD-3-Clause",
    "libImath": "BSD-3-Clause", "libIex": "BSD-3-Clause", "libIlmThread": "BSD-3-Clause", "libpng16": "libpng-2.0",
    "libtiff": "libtiff", "libjpeg": "IJG AND BSD-3-Clause", "libz": "Zlib", "libzstd": "BSD-3-Clause",
    "liblzma": "public domain", "libdeflate": "MIT", "libLerc": "Apache-2.0", "libwebp": "BSD-3-Clause",
    "libtbb": "Apache-2.0",
    "libboost_thread": "BSL-1.0", "libexpat": "MIT", "libpystring": "BSD-3-Clause", "libyaml-cpp": "MIT",
    "libGL": "MIT", "libGLX": "MIT", "libGLdispatch": "MIT", "libX11": "MIT", "libXext": "MIT", "libXau": "MIT",
    "libXdmcp": "MIT", "libxcb": "MIT", "libSM": "MIT", "libICE": "MIT", "libuuid": "BSD-3-Clause",
    "libbsd": "BSD-3-Clause", "libmd": "BSD-3-Clause",
}  # fmt: skip
# What the host's OpenUSD is linked to and its wheel does not bring.
HOST = ("libGL.so.1", "libX11.so.6", "libXext.so.6", "libSM.so.6", "libICE.so.6")


def output(*command: object) -> str:
    """What a program writes; its failure ends the packing."""
    return subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True).stdout


def needed(library: Path) -> list[str]:
    """Sonames that the library asks the loader for."""
    return re.findall(r"\(NEEDED\).*\[(.*)\]", output("readelf", "--dynamic", "--wide", library))


def may_be_packed(soname: str) -> bool:
    return re.sub(r"(-[\d_]+)?\.so.*", "", soname) in LICENCES


def found_by_loader(library: Path) -> dict[str, Path]:
    """Sonames and files of all that the library needs, as this machine's loader finds them."""
    lines = re.findall(r"^\s*(\S+) => (/\S+)", output("ldd", library), re.MULTILINE)
    return {soname: Path(path) for soname, path in lines if not SYSTEM.match(soname)}


def on_this_machine(soname: str) -> Path:
    """A library as the loader's cache has it."""
    line = rf"^\s*{re.escape(soname)} \(libc6,x86-64\) => (/\S+)"
    found = re.search(line, output("/sbin/ldconfig", "-p"), re.MULTILINE)
    if not found:
        raise SystemExit(f"no library {soname} on this machine")
    return Path(found[1])


def closure(start: Iterable[str], found: dict[str, Path]) -> tuple[dict[str, Path], dict[str, Path]]:
    """Libraries to pack, and those to stand in for: what `start` needs, and what that needs in turn."""
    packed, replaced, waiting = {}, {}, list(start)
    while waiting:
        soname = waiting.pop()
        if SYSTEM.match(soname) or soname in packed or soname in replaced:
            continue
        if soname not in found:
            raise SystemExit(f"no library {soname} on this machine")
        if may_be_packed(soname):
            packed[soname] = found[soname]
            waiting += needed(found[soname])
        else:
            replaced[soname] = found[soname]
    return packed, replaced


@functools.cache
def symbols(library: Path, *which: str) -> dict[tuple[str, str], tuple[str, int]]:
    """Dynamic symbols: (name, version) to (nm's letter, size)."""
    lines = output("nm", "--dynamic", "--with-symbol-versions", "--print-size", *which, library).splitlines()
    table = {}
    for line in lines:
        words = line.split()
        name, _, version = words[-1].partition("@")
        size = int(words[1], 16) if len(words) == 4 else 0
        table[name, version.lstrip("@")] = (words[-2], size)
    return table


def stand_in(soname: str, original: Path, users: Iterable[Path], target: Path) -> None:
    """Makes a library that defines what `users` take from `original`, and nothing that it did not write itself."""
    wanted = {key for user in users for key in symbols(user, "--undefined-only")}
    taken = {key: value for key, value in symbols(original, "--defined-only").items() if key in wanted}
    versions: dict[str, list[str]] = {}
    text, data = [], []
    for (name, version), (letter, size) in sorted(taken.items()):
        versions.setdefault(version, []).append(name)
        if letter in "TWi":
            text.append(f".globl {name}\n.type {name},@function\n{name}:")
        else:
            data.append(f".globl {name}\n.type {name},@object\n.size {name},{size}\n{name}: .zero {max(size, 8)}")
    source = "\n".join([
        ".text", *text, "lea empty(%rip), %rax", "ret",
        '.section .note.GNU-stack,"",@progbits', ".data", "empty: .zero 16", *data, "",
    ])  # fmt: skip
    script = "".join(
        f"{version} {{ global: {' '.join(f'{name};' for name in names)} }};\n" for version, names in versions.items()
        if version
    )
    target.with_suffix(".s").write_text(source)
    command = ["cc", "-shared", "-nostdlib", "-s", "-o", target, target.with_suffix(".s"), f"-Wl,-soname,{soname}"]
    if script:
        target.with_suffix(".map").write_text(script)
        command.append(f"-Wl,--version-script,{target.with_suffix('.map')}")
    output(*command)


def licence_texts(libraries: Iterable[Path]) -> dict[str, str]:
    """Debian's copyright files of the packages that the libraries come from, by the package's name."""
    texts = {}
    for library in libraries:
        # A merged /usr: dpkg knows some files by their old place.
        resolved = str(library.resolve())
        places = [resolved, resolved.removeprefix("/usr")]
        found = [answer for place in places if (answer := owner(place))]
        if not found:
            raise SystemExit(f"{library} belongs to no Debian package, so its licence is not known")
        copyright_file = Path("/usr/share/doc") / found[0] / "copyright"
        texts[found[0]] = copyright_file.read_text(encoding="utf-8", errors="replace")
    return texts


def owner(path: str) -> str | None:
    done = subprocess.run(["dpkg-query", "--search", path], check=False, capture_output=True, text=True)
    return done.stdout.split(":", 1)[0] if done.returncode == 0 else None


def newest_glibc(libraries: Iterable[Path]) -> tuple[int, int]:
    """The version of glibc that the libraries ask for."""
    versions = {(2, 28)}
    for library in libraries:
        found = re.findall(r"Name: GLIBC_(\d+)\.(\d+)", output("readelf", "--version-info", "--wide", library))
        versions |= {(int(major), int(minor)) for major, minor in found}
    return max(versions)
