# SPDX-License-Identifier: Apache-2.0
"""Packs what was built into a Python wheel, for `cargo xtask wheel`. Needs nothing but Python and binutils.

    python pack.py --plugin build/wheel/plugin --command target/product/fast/oocpt --out build/dist

The wheel is the same bytes for the same input. Compiled files quote paths of their sources in messages; the folders of
this machine in them are overwritten, at the same length. The path of the wheel is printed.
"""

from __future__ import annotations

import argparse
import base64
import hashlib
import os
import re
import shutil
import sys
import tempfile
import zipfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parent.parent
sys.path.insert(0, str(HERE))

import libraries  # noqa: E402  beside this file

# The package's scripts that the clone has in other places.
SCRIPTS = {"plugin/usdrecord": "_usdrecord.py", "plugin/texture-host": "_texture_host.py",
           "plugin/aov_reader.py": "_aov_reader.py"}  # fmt: skip
# No zip file can be older, and no date is to be in it.
LONG_AGO = (1980, 1, 1, 0, 0, 0)
METADATA = """\
Metadata-Version: 2.1
Name: oocpt
Version: {version}
Summary: An out-of-core path tracer for USD's Hydra on Vulkan GPUs: usdrecord, a command, a Python function
License: Apache-2.0
Classifier: Operating System :: POSIX :: Linux
Classifier: Topic :: Multimedia :: Graphics :: 3D Rendering
Requires-Python: ==3.11.*
Requires-Dist: bpy=={bpy}
Requires-Dist: numpy
Provides-Extra: denoise
Requires-Dist: pyoidn; extra == "denoise"
Description-Content-Type: text/markdown

{description}"""


def version() -> str:
    """The one of the workspace."""
    text = (REPOSITORY / "Cargo.toml").read_text(encoding="utf-8")
    return re.search(r'\[workspace\.package\][^\[]*?version = "([^"]+)"', text)[1]


def bpy_version() -> str:
    """The host that the plugin was built for: the pin of `cargo xtask`, whose default host is the first one."""
    pins = (REPOSITORY / "rust/xtask/src/host/wheels.rs").read_text(encoding="utf-8")
    return re.search(r'Runtime "[^"]+" "bpy==([^"]+)"', pins)[1]


def copy_python(package: Path) -> None:
    shutil.copytree(HERE / "oocpt", package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(
        REPOSITORY / "plugin/schedulers", package / "schedulers", ignore=shutil.ignore_patterns("__pycache__")
    )
    for source, name in SCRIPTS.items():
        shutil.copyfile(REPOSITORY / source, package / name)
    for name in ("usdrecord", "oocpt-texture-host"):
        (package / "bin" / name).chmod(0o755)


def copy_plugin(built: Path, plugin: Path) -> None:
    """The plugin, without symbols that only debuggers read."""
    (plugin / "hdOocPT/resources").mkdir(parents=True)
    for name in ("hdOocPT.so", "hdOocPTImages.so"):
        copy_stripped(built / name, plugin / name)
    shutil.copyfile(built / "hdOocPT/resources/plugInfo.json", plugin / "hdOocPT/resources/plugInfo.json")


def copy_stripped(built: Path, target: Path) -> None:
    shutil.copyfile(built, target)
    libraries.output("strip", "--strip-unneeded", target)
    hide_folders(target)


def copy_command(built: Path, package: Path) -> None:
    copy_stripped(built, package / "bin/oocpt")
    (package / "bin/oocpt").chmod(0o755)


def folders_of_machine() -> list[str]:
    """Where sources may have been compiled from: the clone, and what belongs to its user."""
    home = Path.home()
    chosen = [os.environ.get(name) for name in ("CARGO_HOME", "RUSTUP_HOME", "OOCPT_CACHE")]
    usual = [REPOSITORY, home / ".cargo", home / ".rustup", home / ".cache"]
    return [str(folder).rstrip("/") for folder in [*chosen, *usual] if folder]


def hide_folders(file: Path) -> None:
    """Overwrites the paths of folders of this machine, the longest first, since one may be within another."""
    content = file.read_bytes()
    for folder in sorted(folders_of_machine(), key=len, reverse=True):
        content = content.replace(folder.encode() + b"/", b"/" + b"_" * (len(folder) - 1) + b"/")
    file.write_bytes(content)


def copy_readers(plugin: Path, scratch: Path) -> list[Path]:
    """The libraries of the image readers, and stand-ins; returns the files on this machine that were copied."""
    images, readers = plugin / "hdOocPTImages.so", plugin / "hdOocPT/lib"
    packed, replaced = libraries.closure(libraries.needed(images), libraries.found_by_loader(images))
    readers.mkdir()
    scratch.mkdir()
    for soname, file in packed.items():
        shutil.copyfile(file.resolve(), readers / soname)
    for soname, file in replaced.items():
        libraries.stand_in(soname, file, [readers / name for name in packed], scratch / soname)
        shutil.copyfile(scratch / soname, readers / soname)
    return list(packed.values())


def copy_host_libraries(host: Path) -> list[Path]:
    """What the host needs and its wheel does not bring; returns the files on this machine that were copied."""
    host.mkdir()
    found = {}
    for soname in libraries.HOST:
        found[soname] = place = libraries.on_this_machine(soname)
        found |= libraries.found_by_loader(place)
    for_host, strange = libraries.closure(libraries.HOST, found)
    if strange:
        raise SystemExit(f"the host's libraries need others, whose licences are not known: {sorted(strange)}")
    for soname, file in for_host.items():
        shutil.copyfile(file.resolve(), host / soname)
    return list(for_host.values())


def try_readers(plugin: Path) -> None:
    """Loads the image readers in a new process: what a stand-in lacks is found here, by its name, and whether anything
    came from the machine after all."""
    program = f"import ctypes; ctypes.CDLL({str(plugin / 'hdOocPTImages.so')!r}, mode={os.RTLD_NOW})"
    program += "; print(open('/proc/self/maps').read())"
    mapped = set(re.findall(r"\s(/\S+\.so\S*)$", libraries.output(sys.executable, "-I", "-c", program), re.MULTILINE))
    packed = {file.name for file in (plugin / "hdOocPT/lib").iterdir()}
    strange = sorted(path for path in mapped if Path(path).name in packed and not path.startswith(f"{plugin}/"))
    if strange:
        raise SystemExit(f"the image readers take libraries of this machine, not of the package: {strange}")


def newest_glibc(root: Path) -> tuple[int, int]:
    """The C library that what was compiled asks for."""
    compiled = [file for file in root.rglob("*") if file.is_file() and file.read_bytes()[:4] == b"\x7fELF"]
    return libraries.newest_glibc(compiled)


def write_metadata(root: Path, tag: str, licences: dict[str, str]) -> None:
    info = root / f"oocpt-{version()}.dist-info"
    (info / "licenses/libraries").mkdir(parents=True)
    shutil.copyfile(REPOSITORY / "LICENSE", info / "licenses/LICENSE")
    for package, text in licences.items():
        (info / "licenses/libraries" / f"{package}.txt").write_text(text, encoding="utf-8")
    description = (HERE / "README.md").read_text(encoding="utf-8")
    metadata = METADATA.format(version=version(), bpy=bpy_version(), description=description)
    (info / "METADATA").write_text(metadata, encoding="utf-8")
    (info / "WHEEL").write_text(f"Wheel-Version: 1.0\nGenerator: oocpt\nRoot-Is-Purelib: false\nTag: {tag}\n")
    (info / "entry_points.txt").write_text("[console_scripts]\noocpt = oocpt.__main__:main\n")
    (info / "top_level.txt").write_text("oocpt\n")


def write_wheel(root: Path, wheel: Path) -> None:
    """The files in the order of their names, RECORD last."""
    record = f"oocpt-{version()}.dist-info/RECORD"
    lines = []
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive:
        for file in sorted(path for path in root.rglob("*") if path.is_file()):
            name, content = file.relative_to(root).as_posix(), file.read_bytes()
            digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
            lines.append(f"{name},sha256={digest},{len(content)}\n")
            add(archive, name, content, 0o755 if os.access(file, os.X_OK) else 0o644)
        add(archive, record, "".join([*lines, f"{record},,\n"]).encode(), 0o644)


def add(archive: zipfile.ZipFile, name: str, content: bytes, mode: int) -> None:
    entry = zipfile.ZipInfo(name, LONG_AGO)
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.external_attr = (0o100000 | mode) << 16
    archive.writestr(entry, content)


def pack(arguments: argparse.Namespace) -> Path:
    with tempfile.TemporaryDirectory(prefix="oocpt-package-") as scratch:
        root = Path(scratch) / "root"
        package = root / "oocpt"
        root.mkdir()
        copy_python(package)
        copy_plugin(arguments.plugin, package / "plugin")
        copy_command(arguments.command, package)
        packed = copy_readers(package / "plugin", Path(scratch) / "stand-ins")
        licences = libraries.licence_texts(packed + copy_host_libraries(package / "lib"))
        try_readers(package / "plugin")
        major, minor = newest_glibc(package)
        tag = f"cp311-cp311-manylinux_{major}_{minor}_x86_64"
        write_metadata(root, tag, licences)
        arguments.out.mkdir(parents=True, exist_ok=True)
        wheel = arguments.out / f"oocpt-{version()}-{tag}.whl"
        write_wheel(root, wheel)
    return wheel


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plugin", type=Path, required=True, help="folder with hdOocPT.so")
    parser.add_argument("--command", type=Path, required=True, help="the Rust program oocpt")
    parser.add_argument("--out", type=Path, required=True, help="folder to write the wheel to")
    arguments = parser.parse_args()
    print(pack(arguments))


if __name__ == "__main__":
    main()
