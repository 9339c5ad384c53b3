# SPDX-License-Identifier: Apache-2.0
"""Random products do nothing worse than a message: each is a file or is named in one, and the host lives on.

With `--full`, or OOCPT_HOSTILE_PRODUCTS=N products, many more.
"""

import os
import pathlib
import re
import stat

import OpenEXR
import pytest

import hostile_products

IN_STAGE = 100
PRODUCTS = int(os.environ.get("OOCPT_HOSTILE_PRODUCTS", "4000" if os.environ.get("OOCPT_TEST_FULL") else "200"))
# Renders; gives what the host raised meanwhile, which are the errors of Hydra and of the renderer.
RENDER = """
result, is_done = [], False
engine.SetActiveRenderSettingsPrimPath(Sdf.Path("/Settings"))
view.prepare()
while not is_done:
    try:
        is_done = view.step()
    except Tf.ErrorException as error:
        result.append(str(error))
    time.sleep(0.002)
"""
# What no message may say.
BROKEN = re.compile(r"internal error|panicked|Traceback|exception of unknown", re.IGNORECASE)


def lay_out(folder):
    """What products may find where they are to write."""
    folder.mkdir()
    (folder / "full.exr").symlink_to("/dev/full")
    (folder / "loop.exr").symlink_to("loop.exr")
    (folder / "folder.exr").mkdir()
    (folder / "text.exr").write_text("a text")
    os.mkfifo(folder / "pipe.exr")


def written(folder):
    """The EXR files of a folder, which are whole."""
    found = set()
    for path in folder.rglob("*.exr"):
        if path.is_symlink() or not path.is_file() or path.name == "text.exr":
            continue
        with OpenEXR.File(str(path), separate_channels=True) as file:
            assert file.parts and all(part.channels for part in file.parts), path
        found.add(path)
    return found


def run(fresh_host, folder, seeds, scene_index):
    """Products that were written, and those that a message names, of stages of these seeds."""
    host, counts = fresh_host(scene_index), [0, 0]
    for seed in seeds:
        here = folder / f"{seed}"
        lay_out(here)
        text = hostile_products.stage(seed, str(here), IN_STAGE)
        with host.open(text, (8, 6), camera="/Eye", settings={"enableInteractive": False}) as view:
            view.edit(f"__import__('os').chdir({str(here)!r})")
            log = "\n".join([*view.edit(RENDER), view.pending_log])
        assert not BROKEN.search(log), (seed, BROKEN.search(log), log)
        files = written(here)
        named = {at for at in range(IN_STAGE) if re.search(rf"/P{at}\b", log)}
        # Several names are one file, which is that of the first of its products: others are named.
        counts[0] += len(files)
        counts[1] += len(named)
        silent = silent_products(text, here, files, named)
        (folder / f"{seed}.log").write_text(log)
        assert not silent, (silent, folder / f"{seed}.log")
        assert (here / "text.exr").read_text() == "a text" and stat.S_ISFIFO((here / "pipe.exr").stat().st_mode)
        assert os.readlink(here / "full.exr") == "/dev/full" and os.readlink(here / "loop.exr") == "loop.exr"
        assert not [path for path in here.rglob("*") if path.name.endswith(".tmp")], "nothing is left half done"
    return counts


def silent_products(text, folder, files, named):
    """Products that are neither a file nor in a message."""
    silent = []
    for at in range(IN_STAGE):
        body = text[text.index(f'RenderProduct "P{at}"\n') :]
        name = re.search(r'productName = "(.*)"\n', body).group(1)
        path = pathlib.Path(os.path.normpath(folder / name))
        is_plain = not re.search(r"[<#$\\]|\s$", name)
        is_written = path in files if is_plain else any(files)
        if at not in named and not is_written:
            silent.append((at, name))
    return silent


@pytest.mark.parametrize("scene_index", [False, True], ids=["legacy", "scene_index"])
def test_random_products_are_files_or_messages(fresh_host, tmp_path, scene_index):
    stages = max(PRODUCTS // IN_STAGE // 2, 1)
    first = stages if scene_index else 0
    files, named = run(fresh_host, tmp_path, range(first, first + stages), scene_index)
    assert files > 20 * stages and named > 20 * stages, (files, named)
