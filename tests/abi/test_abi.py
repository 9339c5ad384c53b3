# SPDX-License-Identifier: Apache-2.0
"""The declarations under cpp/abi against the runtime that the plugin was built for.

Needs what `cargo xtask build` makes: OOCPT_BUILD (build tree with the plugin) and OOCPT_HOST_ROOT (wheel host). Missing
things fail the tests, they never skip them. The check itself is checked: a header with two virtual functions swapped
and one with a virtual function missing must both be caught.
"""

import json
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys

import pytest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from vtables import Library, differences, mangle  # noqa: E402

REPO = pathlib.Path(__file__).parents[2]
ABI = REPO / "cpp/abi"

# Classes of the plugin, and the runtime's concrete class with the same interface.
PLUGIN_PAIRS = {
    "HdOocPTRendererPlugin": ("HdStormRendererPlugin",),
    "HdOocPTRenderDelegate": ("HdStRenderDelegate",),
    "HdOocPTRenderPass": ("HdSt_RenderPass",),
    "HdOocPTRenderBuffer": ("HdStRenderBuffer",),
    "HdOocPTPlaceholderSprim": ("HdStMaterial",),
    "HdOocPTPlaceholderRenderSettings": ("HdRenderSettings",),
    "HdOocPTSceneObserver": ("HdMergingSceneIndex", "_Observer"),
    "_PlainMessages": ("UsdUtilsCoalescingDiagnosticDelegate",),
}
# HdStMesh has a slot of HdMesh after those of HdRprim; HdRprim's own table says where they end.
RPRIM = "HdOocPTPlaceholderRprim"

PROBE_PAIRS = {
    "ProbeRendererPlugin": ("HdStormRendererPlugin",),
    "ProbeRenderDelegate": ("HdStRenderDelegate",),
    "ProbeRenderPass": ("HdSt_RenderPass",),
    "ProbeRenderPassState": ("HdRenderPassState",),
    "ProbeRenderBuffer": ("HdStRenderBuffer",),
    "ProbeSprim": ("HdStMaterial",),
    "ProbeBprim": ("HdStRenderBuffer",),
    "ProbeRenderSettings": ("HdRenderSettings",),
    "ProbeInstancer": ("HdInstancer",),
    "ProbeCamera": ("HdCamera",),
    "ProbeSceneDelegate": ("HdSceneDelegate",),
    "ProbeRenderParam": ("HdRenderParam",),
    "ProbeResourceRegistry": ("HdResourceRegistry",),
    "ProbeObserver": ("HdMergingSceneIndex", "_Observer"),
    "ProbeSceneIndex": ("HdMergingSceneIndex",),
    "ProbeVectorDataSource": ("HdRetainedSmallVectorDataSource",),
    "ProbeContainerDataSource": ("HdOverlayContainerDataSource",),
}
# The runtime's classes above that add slots of their own after the interface's.
LONGER = {"ProbeBprim", "ProbeSceneIndex", "ProbeSceneDelegate"}


def setting(name):
    value = os.environ.get(name)
    assert value, f"{name} is not set: run the tests by `cargo xtask test`"
    path = pathlib.Path(value)
    assert path.exists(), f"{name} names {path}, which does not exist"
    return path


@pytest.fixture(scope="session")
def build():
    return setting("OOCPT_BUILD")


@pytest.fixture(scope="session")
def version(build):
    """OpenUSD of the host that the build is for, as in 25.08."""
    (found,) = re.findall(r"^OOCPT_HOST_VERSION:\w+=(\d\d\.\d\d)$", (build / "CMakeCache.txt").read_text(), re.M)
    return found


@pytest.fixture(scope="session")
def namespace(version):
    return f"pxrBlender_v{version.replace('.', '_')}__pxrReserved__"


@pytest.fixture(scope="session")
def runtime(namespace):
    return Library(setting("OOCPT_HOST_ROOT") / "python/bpy/lib/libusd_ms.so", namespace)


@pytest.fixture(scope="session")
def plugin(build, namespace):
    return Library(build / "plugin/hdOocPT.so", namespace)


@pytest.fixture(scope="session")
def probe_path(build):
    subprocess.run(["cmake", "--build", str(build), "--target", "oocpt_abi_probe"], check=True)
    return build / "abi/liboocpt_abi_probe.so"


@pytest.fixture(scope="session")
def probe(probe_path, namespace):
    return Library(probe_path, namespace)


def probe_differences(library, runtime, name):
    ours, theirs = library.slots(name), runtime.slots(*PROBE_PAIRS[name])
    if name in LONGER:
        theirs = theirs[: len(ours)]
    return differences(ours, theirs)


@pytest.mark.parametrize("name", PLUGIN_PAIRS)
def test_plugin_class_has_the_runtimes_slots(plugin, runtime, name):
    ours = ("_GLOBAL__N_1", name) if name.startswith("_") else (name,)
    assert differences(plugin.slots(*ours), runtime.slots(*PLUGIN_PAIRS[name])) == []


def test_plugin_rprim_has_the_runtimes_slots(plugin, runtime):
    ours = plugin.slots(RPRIM)
    assert len(ours) == len(runtime.slots("HdRprim"))
    assert differences(ours, runtime.slots("HdStMesh")[: len(ours)]) == []


@pytest.mark.parametrize("name", PROBE_PAIRS)
def test_declared_interface_has_the_runtimes_slots(probe, runtime, name):
    assert probe_differences(probe, runtime, name) == []


def test_values_are_told_by_the_runtimes_numbers(plugin, runtime):
    """VtValue::IsHolding compares the number of a type; another list of types in the headers would move them."""
    ours, theirs = plugin.value_types(), runtime.value_types()
    shared = ours.keys() & theirs.keys()
    assert {"f", "b", "NS_7TfTokenE", "NS_7GfVec3fE", "NS_7VtArrayINS_7GfVec3fEEE"} <= shared
    assert {name: ours[name] for name in shared} == {name: theirs[name] for name in shared}


def test_sampled_data_source_has_the_runtimes_slots(probe, runtime, namespace):
    token = f"{len('TfToken')}TfToken"
    retained = f"_ZTVN{len(namespace)}{namespace}32HdRetainedTypedSampledDataSourceINS_{token}EEE"
    assert differences(probe.slots("ProbeTokenDataSource"), runtime.slots_of_symbol(retained)) == []


def test_the_bases_end_where_the_runtimes_do(probe, runtime):
    """Interfaces whose concrete classes are longer are held against the runtime's abstract tables."""
    for name, base in (("ProbeBprim", "HdBprim"), ("ProbeSceneIndex", "HdSceneIndexBase"), ("ProbeRprim", "HdRprim")):
        assert len(probe.slots(name)) == len(runtime.slots(base)), name


def host_call(probe_path, function):
    """What a text function of the probe says, called in a process that has the host's libraries loaded."""
    code = (
        "import ctypes, sys; from pxr import Tf; f = getattr(ctypes.CDLL(sys.argv[1]), sys.argv[2]); "
        "f.restype = ctypes.c_char_p; sys.stdout.write(f().decode())"
    )
    python = setting("OOCPT_HOST_PYTHON")
    done = subprocess.run([python, "-I", "-c", code, str(probe_path), function], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_class_sizes_match_the_runtime(probe_path, runtime):
    declared = dict(line.split() for line in host_call(probe_path, "oocpt_abi_sizes").splitlines())
    found = {name: runtime.size_by_destructor(name) for name in declared}
    assert {name: size for name, size in found.items() if size not in (None, int(declared[name]))} == {}
    told = {name for name, size in found.items() if size is not None}
    assert {"HdSceneIndexBase", "HdRenderPassState", "HdCamera", "HdInstancer", "HdRenderSettings"} <= told


def test_values_pass_through_the_runtime(probe_path):
    assert host_call(probe_path, "oocpt_abi_run") == ""


def test_plugin_finds_every_symbol(build):
    """Loading binds all symbols at once, so one that the runtime lacks shows here and not in the middle of a render."""
    code = "import ctypes, os, sys; from pxr import Tf; ctypes.CDLL(sys.argv[1], mode=os.RTLD_NOW)"
    command = [setting("OOCPT_HOST_PYTHON"), "-I", "-c", code, str(build / "plugin/hdOocPT.so")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


# ---- planted faults ----


def compile_with(build, namespace, folder, edit):
    """The probe, compiled against headers in which `edit` changed the text of renderDelegate.h."""
    shutil.copytree(ABI, folder / "abi")
    header = folder / "abi/pxr/imaging/hd/renderDelegate.h"
    text = header.read_text()
    changed = edit(text)
    assert changed != text
    header.write_text(changed)
    commands = json.loads((build / "compile_commands.json").read_text())
    (entry,) = [e for e in commands if e["file"].endswith("tests/abi/probe.cpp")]
    arguments = shlex.split(entry["command"])
    if "ccache" in pathlib.Path(arguments[0]).name:
        arguments = arguments[1:]
    for i in range(len(arguments)):
        if pathlib.Path(arguments[i].removeprefix("-I")) == ABI:
            arguments[i] = f"-I{folder / 'abi'}"
    assert f"-I{folder / 'abi'}" in arguments, "the build no longer names cpp/abi as an include folder"
    output = folder / "faulty.so"
    arguments[arguments.index("-o") + 1] = str(output)
    arguments[arguments.index("-c")] = "-shared"
    arguments += ["-Wno-overloaded-virtual", "-Wl,--unresolved-symbols=ignore-all", "-g0"]
    subprocess.run(arguments, check=True, cwd=entry["directory"])
    return Library(output, namespace)


def swap_two(text):
    first, second = "virtual bool Pause();", "virtual bool IsPaused() const;"
    return text.replace(first, "@").replace(second, first).replace("@", second)


def drop_one(text):
    return text.replace("virtual bool IsStopSupported() const;", "")


def test_a_swap_is_caught(build, namespace, probe_path, runtime, tmp_path):
    faulty = compile_with(build, namespace, tmp_path, swap_two)
    found = probe_differences(faulty, runtime, "ProbeRenderDelegate")
    assert len(found) == 2 and "Pause()" in found[0] and "IsPaused() const" in found[0], found


def test_a_missing_virtual_is_caught(build, namespace, probe_path, runtime, tmp_path):
    faulty = compile_with(build, namespace, tmp_path, drop_one)
    found = probe_differences(faulty, runtime, "ProbeRenderDelegate")
    has = len(runtime.slots("HdStRenderDelegate"))
    assert found and f"{has - 1} slots, the runtime has {has}" in found[0], found


def test_an_absent_class_is_an_error(probe):
    with pytest.raises(LookupError):
        probe.slots("HdNoSuchClass")
    assert mangle("a", "Bc") == "N1a2BcE"
