# SPDX-License-Identifier: Apache-2.0
"""The C++ shim under the address and undefined-behavior sanitizers, through the life of a session in both front ends of
Hydra.

The shim is built a second time, into build/asan, with the sanitizers on and over the same Rust library; the host's
Python preloads the sanitizers' runtimes. Everything a session does to the shim happens there, and any report ends the
process with a status of its own, which is a failure. What the pictures show is compared elsewhere (tests/hydra); here
they must be there.

Leak detection is off: Python and OpenUSD keep interned objects and registries to the end of the process on purpose,
thousands of reports that bury any of the shim's. Leaks of the shim show as growth in tests/hydra/test_lifecycle.py.
"""

from __future__ import annotations

import contextlib
import os
import pathlib
import shutil
import subprocess

import numpy as np
import pytest

import small
import test_scene_reader
import test_edits
import test_textures
from host import Host, HostDied, HostError

HERE = pathlib.Path(__file__).resolve().parent
REPO = HERE.parents[1]
TREE = REPO / "build/asan"
SANITIZERS = "address,undefined"
OPTIONS = {
    "ASAN_OPTIONS": (
        "halt_on_error=1:exitcode=97:detect_leaks=0:detect_stack_use_after_return=1:"
        "strict_string_checks=1:check_initialization_order=1:malloc_context_size=12"
    ),
    "UBSAN_OPTIONS": "halt_on_error=1:exitcode=98:print_stacktrace=1",
}
MODES = {"legacy": False, "scene_index": True}

SIZE = (16, 16)
QUICK = {"oocpt:samplesPerPixel": 1, "oocpt:maxBounces": 1}
ENDLESS = {"oocpt:samplesPerPixel": 1 << 20, "oocpt:maxBounces": 1}
AOVS = ["color", "depth", "cameraDepth", "primId", "instanceId", "elementId", "normal", "Neye", "albedo", "motion"]
SCENES = [
    "nested", "primvars", "native", "implicit", "bad_data", "hidden_instances", "polygons", "smooth", "mirrored",
    "visibility", "transforms", "far_away",
]


def cached(tree: pathlib.Path, name: str) -> str:
    """A value of a build tree's CMake cache."""
    for line in (tree / "CMakeCache.txt").read_text().splitlines():
        if line.partition(":")[0] == name:
            return line.partition("=")[2]
    raise AssertionError(f"{tree} was configured without {name}")


def run(*command: str | pathlib.Path) -> str:
    done = subprocess.run([str(part) for part in command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert done.returncode == 0, f"{' '.join(map(str, command))}: exit status {done.returncode}\n{done.stdout}"
    return done.stdout


@pytest.fixture(scope="module")
def product() -> pathlib.Path:
    """The build tree that `cargo xtask` made: it knows the compiler, the host and the Rust library."""
    assert os.environ.get("OOCPT_BUILD"), "OOCPT_BUILD is not set: run the tests by `cargo xtask test`"
    return pathlib.Path(os.environ["OOCPT_BUILD"])


@pytest.fixture(scope="module")
def runtimes(product) -> list[str]:
    """The sanitizers' libraries of the compiler, in the order in which a process without them must load them.

    libstdc++ goes along: Python does not link it, and the sanitizers look for its exception functions when they start.
    """
    compiler, paths = cached(product, "CMAKE_CXX_COMPILER"), []
    for library in ("libasan.so", "libubsan.so", "libstdc++.so"):
        path = pathlib.Path(run(compiler, f"-print-file-name={library}").strip())
        assert (
            path.is_absolute() and path.exists()
        ), f"{compiler} has no {library}: this test needs the sanitizers that come with g++"
        paths.append(str(path.resolve()))
    return paths


@pytest.fixture(scope="module")
def plugin(product) -> pathlib.Path:
    """hdOocPT.so with the sanitizers in it, built here if it is not up to date."""
    for tool in ("cmake", "ninja", "nm"):
        assert shutil.which(tool), f"{tool} is not in PATH; `cargo xtask test` installs it"
    keep = ["CMAKE_CXX_COMPILER", "OOCPT_HOST_ROOT", "OOCPT_PYTHON_INCLUDE", "OOCPT_BRIDGE_LIB", "OOCPT_BRIDGE_INCLUDE"]
    options = [f"-D{name}={cached(product, name)}" for name in keep]
    if shutil.which("ccache"):
        options.append("-DCMAKE_CXX_COMPILER_LAUNCHER=ccache")
    # No optimization and lines without variables: half the time to compile, and reports still name the line.
    options += ["-DCMAKE_BUILD_TYPE=Sanitized", "-DCMAKE_CXX_FLAGS_SANITIZED=-O0 -g1", f"-DOOCPT_SANITIZE={SANITIZERS}"]
    run("cmake", "-G", "Ninja", "-S", REPO / "cpp", "-B", TREE, *options)
    run("cmake", "--build", TREE, "--target", "hdOocPT")
    library = TREE / "plugin/hdOocPT.so"
    needed = run("nm", "--dynamic", "--undefined-only", library)
    for symbol in ("__asan_init", "__asan_report_load8", "__ubsan_handle"):
        assert symbol in needed, f"{library} does not call {symbol}: it was not built with {SANITIZERS}"
    return library


def standard_error(host: Host):
    """The file in which a process keeps what it wrote since its last answer; readable after its death too."""
    try:
        host.call("no_such_command")
    except HostDied:
        raise
    except HostError:
        # The answer came: the process has set up its end.
        pass
    return open(f"/proc/{host.pid}/fd/2", "rb")


class Watched:
    """Makes rendering processes with the sanitizers loaded, and collects what they report."""

    def __init__(self, folder: pathlib.Path, runtimes: list[str], plugin: pathlib.Path) -> None:
        self.folder, self._plugin = folder, plugin
        self._environment = {
            "LD_PRELOAD": " ".join(runtimes),
            "PXR_PLUGINPATH_NAME": str(plugin.parent / "hdOocPT/resources"),
        }
        self._environment |= OPTIONS
        # tests/hydra has the validation layer on; here its records would go through the sanitizers' allocator.
        self._environment["OOCPT_VALIDATION"] = "0"
        # libasan writes here; libubsan, which finds libasan's function for it in place of its own, to standard error.
        self._environment["ASAN_OPTIONS"] += f":log_path={folder / 'asan'}"

    def reports(self) -> str:
        return "\n".join(path.read_text(errors="replace") for path in sorted(self.folder.glob("asan.*")))

    @contextlib.contextmanager
    def host(self, scene_index: bool = False):
        """A process that must end in good order and without a report."""
        host = Host(self.folder, scene_index, self._environment)
        with contextlib.ExitStack() as stack:
            last_words = None
            try:
                last_words = stack.enter_context(standard_error(host))
                yield host
                host.close()
            except HostDied as error:
                said = last_words.read().decode(errors="replace") if last_words else ""
                raise AssertionError(
                    f"{error}\n"
                    f"reports: {self.reports() or 'no file'}\n"
                    f"standard error: {said or 'nothing'}"
                ) from error
            finally:
                with contextlib.suppress(HostDied):
                    host.close()
        assert not self.reports(), self.reports()

    def check_loaded(self, host: Host) -> None:
        """The process runs the plugin that was built for it, and not the other one."""
        maps = pathlib.Path(f"/proc/{host.pid}/maps").read_text()
        plugins = {line.split()[-1] for line in maps.splitlines() if line.endswith("hdOocPT.so")}
        assert plugins == {str(self._plugin)}, f"loaded: {plugins}"
        assert "libasan" in maps and "libubsan" in maps, "the sanitizers are not in the process"


@pytest.fixture
def watched(tmp_path, runtimes, plugin) -> Watched:
    return Watched(tmp_path, runtimes, plugin)


def seen(picture, what: str) -> None:
    """Something is in the picture, and all of it is finite."""
    assert picture.arrays, f"{what}: no picture"
    for name, array in picture.arrays.items():
        assert array.size and np.isfinite(array).all(), f"{what}: {name} is empty or not finite"
    assert picture["color"].any(), f"{what}: the picture is black"
    if "primId" in picture.arrays:
        assert (picture["primId"] >= 0).any(), f"{what}: no prim is in the picture"


def scenes(host) -> None:
    """An engine for each scene: made, rendered in every AOV, asked, destroyed."""
    for name in SCENES:
        with host.open(small.FOLDER / f"{name}.usda", SIZE, settings=QUICK, aovs=AOVS) as view:
            picture = view.render()
            seen(picture, name)
            view.decode({
                (prim, instance)
                for prim, instance in zip(picture["primId"].ravel(), picture["instanceId"].ravel())
                if prim >= 0
            })
            assert view.stats()["numCompletedSamples"] == 1, name
    for camera in ("Plain", "Orthographic", "Offset", "Wide", "Lens"):
        seen(host.picture(small.FOLDER / "cameras.usda", SIZE, camera=f"/World/{camera}", settings=QUICK), camera)


def edits(host) -> None:
    """Every edit of tests/hydra in one live engine, undone each time; then the same engine without any prim, and with
    them again."""
    with host.open(small.FOLDER / "glow.usda", SIZE, settings=QUICK, aovs=AOVS) as view:
        seen(view.render(), "before the edits")
        view.edit("view.saved = stage.GetRootLayer().ExportToString()")
        for name, code in test_edits.EDITS.items():
            view.edit(test_edits.PRELUDE + code)
            seen(test_edits.render_after_edit(view, name), name)
            view.edit("stage.GetRootLayer().ImportFromString(view.saved)")
        for size in ((24, 10), (1, 1), SIZE):
            view.edit(f"view.size = {size}")
            assert view.render()["color"].shape[:2] == size[::-1]
        view.edit("view.aovs = ['color', 'depth']")
        seen(view.render(), "fewer AOVs")
        seen(view.render(), "all undone")
        view.edit(
            "for child in stage.GetPrimAtPath('/World').GetChildren():\n"
            "    if child.GetName() not in ('Camera', 'Pebbles', 'Dome'):\n"
            "        stage.RemovePrim(child.GetPath())"
        )
        seen(view.render(), "most prims removed")
        view.edit("stage.GetRootLayer().ImportFromString(view.saved)")
        seen(view.render(), "prims back")


def materials(host) -> None:
    """Materials, subsets, links and lights of every kind with edits of them; good, damaged and missing textures."""
    folder = host._folder
    (folder / "a.1001.png").write_bytes(b"no image")
    (folder / "arrivals.usda").write_text(
        test_scene_reader.SCENE.replace("@TEXTURE@", "@./a.<UDIM>.png@", 1).replace("@TEXTURE@", "@./a.1001.png@")
    )
    with host.open(folder / "arrivals.usda", SIZE, settings=QUICK) as view:
        view.render()
        for code in test_scene_reader.EDITS:
            view.edit(code)
            view.render()
    for name, kind in (("good.png", np.uint8), ("good.tif", np.uint8), ("good.exr", np.float16)):
        test_textures.write(folder / name, test_textures.texels(kind))
        seen(test_textures.picture(host, folder, f"./{name}"), name)
    for name, make in test_textures.BAD.items():
        make(folder / name)
        seen(test_textures.picture(host, folder, f"./{name}"), name)


def control(host) -> None:
    """Pause, resume, stop, restart, edits and resizes in the middle, engines side by side and destroyed while they
    render."""
    path = small.FOLDER / "glow.usda"
    with (
        host.open(path, SIZE, settings=ENDLESS) as view,
        host.open(small.FOLDER / "nested.usda", SIZE, settings=QUICK) as other,
    ):
        view.edit("view.prepare(); view.step(); time.sleep(0.05); view.step()")
        seen(other.render(), "beside an engine that renders")
        view.edit("engine.PauseRenderer(); view.step(); engine.ResumeRenderer(); view.step()")
        view.edit(
            test_edits.PRELUDE
            + test_edits.EDITS["instance_positions"]
            + "\nview.step(); view.size = (20, 12); view.prepare(); view.step()"
        )
        assert view.edit(
            "engine.StopRenderer()\n"
            "start = time.monotonic()\n"
            "while not view.step() and time.monotonic() - start < 60:\n"
            "    time.sleep(0.01)\n"
            "result = engine.IsConverged()"
        )
        view.edit(
            "engine.SetRendererSetting('oocpt:samplesPerPixel', 2)\n"
            "engine.SetRendererSetting('oocpt:noSuchThing', 1)\n"
            "engine.SetRendererSetting('oocpt:clamp', 'much')"
        )
        view.edit("result = len(engine.GetRendererSettingsList())\nengine.RestartRenderer()")
        seen(view.render(), "restarted")
    gone = host.open(path, SIZE, settings=ENDLESS)
    gone.edit("view.prepare(); view.step(); time.sleep(0.05)")
    host.call("close", viewer=gone.name)
    host.call("close", viewer=host.open(path, SIZE, settings=QUICK).name)


def errors(host) -> None:
    """Renders that end in an error of the delegate, and a camera that nothing can be seen by."""
    with (
        host.open(small.FOLDER / "glow.usda", (64, 64), settings=QUICK | {"oocpt:memoryBudget": 1}) as view,
        pytest.raises(HostError, match="(?i)memory|budget"),
    ):
        view.render(60)
    for size in ((100_000, 100_000), (0, 0)):
        with host.open(small.FOLDER / "glow.usda", size, settings=QUICK) as view, contextlib.suppress(HostError):
            view.render(60)
    with host.open(small.FOLDER / "glow.usda", SIZE, settings=QUICK) as view:
        view.edit("UsdGeom.Camera(stage.GetPrimAtPath('/World/Camera')).GetFocalLengthAttr().Set(float('nan'))")
        with contextlib.suppress(HostError):
            view.render(60)


@pytest.mark.parametrize("mode", MODES)
def test_a_session_gives_no_sanitizer_report(watched, mode):
    with watched.host(MODES[mode]) as host:
        scenes(host)
        watched.check_loaded(host)
        edits(host)
        materials(host)
        control(host)
        errors(host)
        host.call(
            "record", stage=str(small.FOLDER / "native.usda"), out=str(watched.folder / "recorded.exr"), width=SIZE[0]
        )
        assert (watched.folder / "recorded.exr").stat().st_size > 0
        host.call("cycles", stage=str(small.FOLDER / "hidden_instances.usda"), count=20, every=20)


PLANTED = r"""
#include <climits>
#include <vector>
extern "C" int overflow(int length) {
    std::vector<int> values(length, 7); volatile int *data = values.data(); return data[length];
}
extern "C" int after_free(int length) {
    int *values = new int[length]; volatile int *data = values; delete[] values; return data[0];
}
extern "C" int undefined(int step) { volatile int most = INT_MAX; return most + step; }
extern "C" int harmless(int length) { std::vector<int> values(length, 7); return values[length - 1]; }
"""


@pytest.fixture(scope="module")
def planted(product, tmp_path_factory) -> pathlib.Path:
    """A library of faults, compiled with the sanitizers of the shim."""
    folder = tmp_path_factory.mktemp("planted")
    source, library = folder / "planted.cpp", folder / "planted.so"
    source.write_text(PLANTED)
    run(
        cached(product, "CMAKE_CXX_COMPILER"), "-shared", "-fPIC", "-O1", f"-fsanitize={SANITIZERS}", source, "-o",
        library,
    )
    return library


FAULTS = {
    "overflow": "heap-buffer-overflow", "after_free": "heap-use-after-free", "undefined": "signed integer overflow"
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_planted_fault_is_reported(watched, planted, fault):
    """In the same process, after a render, by the same way: the session's test would fail."""
    with pytest.raises(AssertionError, match=FAULTS[fault]), watched.host() as host:
        seen(host.picture(small.FOLDER / "nested.usda", SIZE, settings=QUICK), "before the fault")
        with host.open(small.FOLDER / "nested.usda", SIZE, settings=QUICK) as view:
            call = f"import ctypes\nlibrary = ctypes.CDLL({str(planted)!r})\n"
            assert view.edit(call + "result = library.harmless(9)") == 7 and not watched.reports()
            view.edit(call + f"library.{fault}(9)")
