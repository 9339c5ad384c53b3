# SPDX-License-Identifier: Apache-2.0
"""Packs what was built into an extension of Blender, for `cargo xtask blender`. Needs nothing but Python and binutils.

    python pack.py --plugin build/wheel/plugin --out build/dist

The zip is the same bytes for the same input. Its path is printed, then its size, and the C library that it needs.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
import tempfile
import zipfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "package"))

import libraries  # noqa: E402  the Python package's
import pack as package  # noqa: E402  the same


def pin(root: Path, bpy: str, openusd: str) -> str:
    """Writes into the manifest and the add-on which Blender and which OpenUSD the plugin is compiled for. Returns the
    version of Blender."""
    major, minor = map(int, bpy.split(".")[:2])
    put(root / "blender_manifest.toml", "blender_version_min", f'"{major}.{minor}.0"')
    put(root / "blender_manifest.toml", "blender_version_max", f'"{major}.{minor + 1}.0"')
    put(root / "pins.py", "BLENDER", f'"{major}.{minor}"')
    put(root / "pins.py", "OPENUSD", str((0, *map(int, openusd.split(".")))))
    return f"{major}.{minor}"


def put(file: Path, name: str, value: str) -> None:
    text, count = re.subn(rf"^{name} = .*$", f"{name} = {value}", file.read_text(encoding="utf-8"), flags=re.MULTILINE)
    if count != 1:
        raise SystemExit(f"{file.name} has {count} lines for {name}")
    file.write_text(text, encoding="utf-8")


def check_version(root: Path) -> str:
    """Blender reads the manifest as it is, so the version stands in it."""
    manifest = (root / "blender_manifest.toml").read_text(encoding="utf-8")
    version = re.search(r'^version = "([^"]+)"', manifest, re.MULTILINE)[1]
    if version != package.version():
        raise SystemExit(f"blender_manifest.toml is of {version}, not of what was built")
    return version


def write_zip(root: Path, target: Path) -> None:
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive:
        for name in sorted(path.relative_to(root).as_posix() for path in root.rglob("*") if path.is_file()):
            package.add(archive, name, (root / name).read_bytes(), 0o644)


def pack(host: argparse.Namespace) -> tuple[Path, tuple[int, int]]:
    with tempfile.TemporaryDirectory(prefix="oocpt-blender-") as scratch:
        root = Path(scratch) / "oocpt"
        shutil.copytree(HERE / "oocpt", root, ignore=shutil.ignore_patterns("__pycache__"))
        version, blender = check_version(root), pin(root, host.bpy, host.openusd)
        package.copy_plugin(host.plugin, root / "plugin")
        packed = package.copy_readers(root / "plugin", Path(scratch) / "stand-ins")
        package.try_readers(root / "plugin")
        shutil.copyfile(package.REPOSITORY / "LICENSE", root / "LICENSE")
        (root / "licenses").mkdir()
        for name, text in libraries.licence_texts(packed).items():
            (root / "licenses" / f"{name}.txt").write_text(text, encoding="utf-8")
        glibc = package.newest_glibc(root)
        host.out.mkdir(parents=True, exist_ok=True)
        target = host.out / f"oocpt-{version}-blender-{blender}-linux-x64.zip"
        write_zip(root, target)
    return target, glibc


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plugin", type=Path, required=True, help="folder with hdOocPT.so")
    parser.add_argument("--out", type=Path, required=True, help="folder to write the zip to")
    for name in ("openusd", "bpy"):
        parser.add_argument(f"--{name}", default=package.PINS[name.upper()], help="the host's, if not the default")
    target, (major, minor) = pack(parser.parse_args())
    print(target)
    print(f"{target.stat().st_size / 1e6:.1f} MB, glibc {major}.{minor} or newer", file=sys.stderr)


if __name__ == "__main__":
    main()
