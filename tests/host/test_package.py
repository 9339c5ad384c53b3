# SPDX-License-Identifier: Apache-2.0
"""The Python package as a user has it: packed from what was built, installed by pip, used in a process of its own. The
wheel host stands for the package `bpy`, whose OpenUSD it is. Runs in the wheel host's Python."""

import base64
import csv
import hashlib
import io
import json
import os
import pathlib
import re
import struct
import subprocess
import sys
import zipfile

import numpy
import pytest

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
PACKAGE = REPOSITORY / "plugin" / "package"
sys.path.append(str(PACKAGE))

import libraries  # noqa: E402  the packer's

COLORS = {"png": 0.5, "jpg": 0.25, "tif": 0.75, "exr": 2.0, "hdr": 4.0, "bmp": 0.5, "tga": 0.75}
SQUARE = """def Mesh "square_{name}" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [({x}, -1, 0), ({right}, -1, 0), ({right}, 0, 0), ({x}, 0, 0)]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (
        interpolation = "vertex"
    )
    rel material:binding = </looks/{name}>
}}
"""
MATERIAL = """def Material "{name}"
    {{
        token outputs:surface.connect = </looks/{name}/surface.outputs:surface>
        def Shader "surface"
        {{
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (0, 0, 0)
            float inputs:ior = 1
            color3f inputs:emissiveColor.connect = </looks/{name}/texture.outputs:rgb>
            token outputs:surface
        }}
        def Shader "texture"
        {{
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @{file}@
            token inputs:sourceColorSpace = "raw"
            float2 inputs:st.connect = </looks/{name}/coordinates.outputs:result>
            float3 outputs:rgb
        }}
        def Shader "coordinates"
        {{
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }}
    }}
"""
SCENE = """#usda 1.0
(
    upAxis = "Y"
)
def Sphere "ball"
{{
    double radius = 0.5
    color3f[] primvars:displayColor = [(0.8, 0.4, 0.1)]
    double3 xformOp:translate = (1, 0.6, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
def Camera "front"
{{
    float2 clippingRange = (1, 100)
    token projection = "orthographic"
    float horizontalAperture = 40
    float verticalAperture = 30
    double3 xformOp:translate = (0, 0, 10)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
def Camera "side"
{{
    float2 clippingRange = (1, 100)
    token projection = "orthographic"
    float horizontalAperture = 40
    float verticalAperture = 30
    double3 xformOp:translate = (0, 0, 10)
    double xformOp:rotateY = 60
    uniform token[] xformOpOrder = ["xformOp:rotateY", "xformOp:translate"]
}}
def DomeLight "sky"
{{
    float inputs:intensity = 0.5
}}
def "looks"
{{
    {materials}
}}
{squares}
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    out = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-I", PACKAGE / "pack.py", "--plugin", f"{os.environ['OOCPT_BUILD']}/plugin"]
    command += ["--command", os.environ["OOCPT_CLI"], "--out", out]
    done = subprocess.run(command, capture_output=True, text=True, check=False, start_new_session=True)
    assert done.returncode == 0, done.stderr
    return pathlib.Path(done.stdout.strip())


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """Variables of a process in which the package is installed."""
    site = tmp_path_factory.mktemp("site")
    pip = [sys.executable, "-I", "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--no-compile"]
    subprocess.run([*pip, "--disable-pip-version-check", "--target", site, wheel], check=True, capture_output=True)
    variables = {key: value for key, value in os.environ.items() if not key.startswith(("PXR_", "OOCPT_HOST"))}
    variables["PATH"] = "/usr/bin:/bin"
    variables["PYTHONPATH"] = os.pathsep.join([str(site), f"{os.environ['OOCPT_HOST_ROOT']}/python"])
    return variables


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A ball above a row of squares, each shining as its picture says."""
    folder = tmp_path_factory.mktemp("scene")
    for extension, value in COLORS.items():
        write_image(folder / f"picture.{extension}", value)
    (folder / "picture.jbig.tif").write_bytes(jbig_tiff())
    files = [*(f"picture.{extension}" for extension in COLORS), "picture.jbig.tif"]
    names = [file.split(".", 1)[1].replace(".", "_") for file in files]
    materials = [MATERIAL.format(name=name, file=f"./{file}") for name, file in zip(names, files, strict=True)]
    squares = [SQUARE.format(name=name, x=x / 2 - 2, right=x / 2 - 1.5) for x, name in enumerate(names)]
    path = folder / "scene.usda"
    path.write_text(SCENE.format(materials="\n".join(materials), squares="\n".join(squares)))
    return path


def write_image(path, value):
    import OpenImageIO as oiio

    is_float = path.suffix in (".exr", ".hdr")
    image = oiio.ImageBuf(oiio.ImageSpec(8, 8, 3, oiio.FLOAT if is_float else oiio.UINT8))
    oiio.ImageBufAlgo.fill(image, (value, value, value))
    assert image.write(str(path)), image.geterror()


def jbig_tiff():
    """A TIFF of a compression whose library is not packed: libtiff knows it, and finds a stand-in."""
    entries = [(256, 8), (257, 8), (258, 1), (259, 34661), (262, 1), (273, 8), (277, 1), (278, 8), (279, 32)]
    fields = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in entries)
    return struct.pack("<2sHI", b"II", 42, 40) + bytes(range(32)) + struct.pack("<H", len(entries)) + fields + b"\0" * 4


def run(variables, *words, **more):
    return subprocess.run(
        [sys.executable, *map(str, words)], env={**variables, **more}, capture_output=True, text=True, timeout=120,
        stdin=subprocess.DEVNULL, start_new_session=True, check=False,
    )  # fmt: skip


def entries_of(wheel):
    with zipfile.ZipFile(wheel) as archive:
        return {entry.filename: archive.read(entry) for entry in archive.infolist()}


def test_the_record_lists_every_file_with_its_hash(wheel):
    entries = entries_of(wheel)
    name = next(entry for entry in entries if entry.endswith(".dist-info/RECORD"))
    rows = {row[0]: row[1:] for row in csv.reader(io.StringIO(entries[name].decode()))}
    assert set(rows) == set(entries) and rows.pop(name) == ["", ""]
    for file, (digest, size) in rows.items():
        expected = base64.urlsafe_b64encode(hashlib.sha256(entries[file]).digest()).rstrip(b"=").decode()
        assert (digest, int(size)) == (f"sha256={expected}", len(entries[file])), file


def test_programs_of_farms_are_in_the_package(wheel):
    names = {path.name for path in (REPOSITORY / "plugin/schedulers").iterdir() if path.is_file()}
    packed = entries_of(wheel)
    assert names == {name.rsplit("/", 1)[1] for name in packed if name.startswith("oocpt/schedulers/")}, names
    metadata = next(text for name, text in packed.items() if name.endswith("/METADATA")).decode()
    assert 'Provides-Extra: ray\nRequires-Dist: ray; extra == "ray"\n' in metadata, metadata


def test_the_metadata_pin_the_host_and_tell_the_c_library(wheel):
    entries = entries_of(wheel)
    metadata = next(text for name, text in entries.items() if name.endswith("/METADATA")).decode()
    pins = (REPOSITORY / "rust/xtask/src/host/wheels.rs").read_text(encoding="utf-8")
    assert f"Requires-Dist: {re.search('bpy==[0-9.]+', pins)[0]}\n" in metadata and "Requires-Dist: numpy" in metadata
    asked = {int(found) for content in entries.values() for found in re.findall(rb"\0GLIBC_2\.(\d+)(?=\0)", content)}
    tag = re.fullmatch(r"oocpt-[0-9.]+-(cp311-cp311-manylinux_2_(\d+)_x86_64)\.whl", wheel.name)
    assert int(tag[2]) == max(asked)
    assert next(text for name, text in entries.items() if name.endswith("/WHEEL")).decode().endswith(f"Tag: {tag[1]}\n")


def test_no_file_names_a_folder_of_this_machine(wheel):
    folders = [REPOSITORY, os.environ["OOCPT_HOST_ROOT"], os.environ.get("CARGO_HOME"), pathlib.Path.home() / ".cargo"]
    for name, content in entries_of(wheel).items():
        for folder in filter(None, folders):
            assert f"{folder}/".encode() not in content, f"{name} names {folder}"


def test_libraries_are_free_to_hand_on_or_empty(wheel):
    entries = entries_of(wheel)
    packed = {name: content for name, content in entries.items() if re.match(r"oocpt/(plugin/hdOocPT/)?lib/", name)}
    assert len(packed) > 40
    stand_ins = {name for name in packed if not libraries.may_be_packed(name.rsplit("/", 1)[1])}
    assert {"libavcodec", "libjbig", "libopenvdb"} <= {name.rsplit("/", 1)[1].split(".")[0] for name in stand_ins}
    # Names alone: the largest library of them has 55 MB in truth.
    assert all(len(packed[name]) < 20_000 for name in stand_ins)
    texts = [name for name in entries if "/licenses/libraries/" in name]
    assert len(texts) > 15 and all(entries[name] for name in texts)
    assert wheel.stat().st_size < 60 << 20


PROGRAM = """
import json, sys, numpy, oocpt
from pxr import Usd, UsdGeom
reported = []
picture = oocpt.render(sys.argv[1], camera="front", width=64, samples=16, aovs=("color", "cameraDepth", "primId"),
                       settings={"maxBounces": 1}, progress=reported.append)
stage = Usd.Stage.Open(sys.argv[1])
for prim in [prim for prim in stage.GetPseudoRoot().GetChildren() if prim.GetTypeName() in ("Mesh", "Camera")]:
    prim.SetActive(False)
UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
edited = oocpt.render(stage, width=16, height=16, samples=1, aovs=["primId", "normal"],
                      settings={"oocpt:maxBounces": 0})
with open(sys.argv[2] + "/shown.png", "wb") as file:
    file.write(picture._repr_png_())
numpy.savez(sys.argv[2] + "/arrays.npz", ids=edited["primId"], normals=edited["normal"], **picture)
print(json.dumps([reported, picture.messages, picture.statistics["numCompletedSamples"], repr(edited)]))
"""


@pytest.fixture(scope="module")
def rendered(installed, scene, tmp_path_factory):
    """What the program above leaves: arrays, the shown picture, and what it printed."""
    folder = tmp_path_factory.mktemp("rendered")
    done = run(installed, "-c", PROGRAM, scene, folder)
    assert done.returncode == 0, done.stderr
    with numpy.load(folder / "arrays.npz") as arrays:
        return dict(arrays), folder / "shown.png", json.loads(done.stdout)


def test_a_scene_renders_to_arrays_from_the_top_down(rendered):
    arrays, _, (reported, _, samples, text) = rendered
    color, depth, ids = arrays["color"], arrays["cameraDepth"], arrays["primId"]
    assert (color.shape, depth.shape, ids.shape) == ((48, 64, 4), (48, 64), (48, 64))
    assert (color.dtype, depth.dtype, ids.dtype) == (numpy.float32, numpy.float32, numpy.int32)
    # The camera sees 4 x 3 units; the ball's middle is 1 to the right of the picture's and 0.6 above it.
    row, column = round(24 - 0.6 * 16), round(32 + 16)
    # A convex body under an even sky, but for what the squares below send.
    numpy.testing.assert_allclose(color[row - 6, column], [0.4, 0.2, 0.05, 1.0], rtol=0.15)
    numpy.testing.assert_allclose(depth[row, column], 9.5, atol=0.01)
    assert ids[row, column] >= 0 and ids[row, 2] == -1 and depth[row, 2] == 0
    assert samples == 16 and reported[-1] == 1.0 and all(0 <= value <= 1 for value in reported)
    assert text == "<oocpt.Picture primId int32[16, 16], normal float32[16, 16, 3]>"


def test_a_stage_without_cameras_is_framed_as_it_was_edited(rendered):
    arrays, _, _ = rendered
    is_ball = arrays["ids"] >= 0
    assert len(set(arrays["ids"][is_ball])) == 1, "the squares are inactive"
    assert 0.2 < is_ball.mean() < 0.8 and (is_ball == is_ball[:, ::-1]).all() and (is_ball == is_ball[::-1]).all()
    # Seen from -y with z up: the first row is the upper one.
    assert arrays["normals"][is_ball][0, 2] > 0.5 and (arrays["normals"][is_ball][:, 1] < 0.1).all()


def test_packed_readers_read_each_kind_of_image(rendered):
    arrays, _, (_, messages, _, _) = rendered
    row = arrays["color"][32]
    for at, (extension, value) in enumerate(COLORS.items()):
        pixel = row[4 + at * 8]
        numpy.testing.assert_allclose(pixel[:3], value, rtol=0.02, err_msg=extension)
    assert any("jbig.tif" in message for message in messages), messages
    assert not any(f"picture.{extension}" in message for message in messages for extension in COLORS), messages


def test_a_notebook_shows_the_colour(rendered):
    import OpenImageIO as oiio

    arrays, shown, _ = rendered
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    pixels = oiio.ImageInput.open(str(shown), config).read_image("unknown")
    assert pixels.shape == (48, 64, 4) and pixels.dtype == numpy.uint8
    opaque = arrays["color"][..., 3] == 1
    linear = numpy.clip(arrays["color"][..., :3].astype(float), 0, 1)
    expected = numpy.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055) * 255
    assert numpy.abs(pixels[..., :3] - expected)[opaque].max() <= 0.51
    assert (pixels[..., 3] == numpy.rint(arrays["color"][..., 3] * 255)).all()


GOING_ON = """
import sys, numpy, oocpt
scene, file = sys.argv[1], sys.argv[2] + "/samples"
of = lambda samples, **more: oocpt.render(scene, camera="/front", width=24, samples=samples, camera_light=False, **more)
at_once, first, then = of(4), of(2, checkpoint=file), of(4, checkpoint=file)
assert then.statistics["oocpt:samplesKept"] == 2 and first.statistics["oocpt:samplesKept"] == 0, then.statistics
assert (then["color"] == at_once["color"]).all() and (first["color"] != at_once["color"]).any()
"""


def test_a_render_goes_on_from_a_checkpoint(installed, scene, tmp_path):
    done = run(installed, "-c", GOING_ON, scene, tmp_path)
    assert done.returncode == 0, done.stderr


def test_record_writes_what_render_returns(installed, scene, rendered, tmp_path):
    import OpenImageIO as oiio

    target = tmp_path / "out.exr"
    words = ["--camera", "/front", "-w", 64, "--samples", 16, "--set", "maxBounces=1", "--disableCameraLight"]
    done = run(installed, "-m", "oocpt", "record", *words, "--enableDomeLightVisibility", scene, target)
    assert done.returncode == 0, done.stderr
    pixels = oiio.ImageInput.open(str(target)).read_image("unknown")
    numpy.testing.assert_array_equal(pixels, rendered[0]["color"])


LIT = """
import sys, numpy, oocpt
picture = oocpt.render(sys.argv[1], camera="side", width=16, samples=4, camera_light=True)
numpy.save(sys.argv[2] + "/lit.npy", picture["color"])
oocpt.usdrecord(["--camera", "side", "-w", "16", "--samples", "4", "--enableDomeLightVisibility", sys.argv[1],
                 sys.argv[2] + "/lit.exr"])
"""


def test_the_light_at_the_camera_is_that_of_usdrecord(installed, scene, rendered, tmp_path):
    import OpenImageIO as oiio

    done = run(installed, "-c", LIT, scene, tmp_path)
    assert done.returncode == 0, done.stderr
    lit = numpy.load(tmp_path / "lit.npy")
    numpy.testing.assert_array_equal(oiio.ImageInput.open(str(tmp_path / "lit.exr")).read_image("unknown"), lit)
    # The ball's middle seen from 60 degrees to the right, lit from there.
    assert lit[3, 10, 0] > 1.5 * rendered[0]["color"][14, 50, 0]


def test_a_missing_driver_is_said_with_what_to_install(installed, scene, tmp_path):
    program = "import oocpt, sys; oocpt.render(sys.argv[1], width=16)"
    for words in (["-c", program, scene], ["-m", "oocpt", "record", "-w", 16, scene, tmp_path / "out.exr"]):
        done = run(installed, *words, VK_DRIVER_FILES="/nonexistent", VK_ICD_FILENAMES="/nonexistent")
        assert done.returncode == 1 and not (tmp_path / "out.exr").exists()
        assert "no Vulkan driver is installed" in done.stderr and "mesa-vulkan-drivers" in done.stderr, done.stderr
        assert "apt-get install mesa-vulkan-drivers" in done.stderr or "record" in words, done.stderr


WRONG = """
import json, sys, oocpt
said = []
for scene, words in [(sys.argv[1], {"camera": "nowhere"}), (sys.argv[1], {"settings": {"samplesPerPixels": 1}}),
                     (sys.argv[1] + ".none", {}), (sys.argv[1], {"aovs": ["nothing"]}), (sys.argv[1], {"width": 0}),
                     (sys.argv[1], {"aovs": "color"})]:
    try:
        oocpt.render(scene, **{"width": 16, **words})
    except (oocpt.RenderError, ValueError) as error:
        said.append([type(error).__name__, str(error)])
print(json.dumps(said))
"""


def test_what_is_wrong_is_said_in_one_error(installed, scene):
    done = run(installed, "-c", WRONG, scene)
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    kinds = [kind for kind, _ in said]
    assert kinds == ["RenderError"] * 4 + ["ValueError"] * 2, said
    for (_, text), part in zip(said, ["/front", "samplesPerPixel", ".none", "nothing", "0", "names"], strict=True):
        assert part in text and "\n" not in text, text


STOPPED = """
import os, sys, oocpt
def stop(fraction):
    raise KeyboardInterrupt
try:
    oocpt.render(sys.argv[1], width=256, samples=1000000, progress=stop)
except KeyboardInterrupt:
    try:
        os.waitpid(-1, os.WNOHANG)
    except ChildProcessError:
        print("nobody renders")
"""


def test_an_interrupt_ends_the_process_that_renders(installed, scene):
    done = run(installed, "-c", STOPPED, scene)
    assert done.stdout == "nobody renders\n", done.stderr


def test_without_its_host_the_package_says_what_to_install(installed):
    site = installed["PYTHONPATH"].split(os.pathsep)[0]
    done = run(installed, "-m", "oocpt", "record", "a.usda", "b.exr", PYTHONPATH=site)
    assert done.returncode == 1 and "pip install bpy==5.0.1" in done.stderr, done.stderr
    done = run(installed, "-m", "oocpt", "--help", PYTHONPATH=site)
    assert done.returncode == 0 and "doctor" in done.stdout and "oocpt record" in done.stdout, done.stdout


def test_the_package_has_no_benches_and_says_how_to_build_them(installed, wheel):
    with zipfile.ZipFile(wheel) as packed:
        assert not [name for name in packed.namelist() if "bench" in name]
    done = run(installed, "-m", "oocpt", "bench", "island", "--help", RUST_BACKTRACE="0")
    assert done.returncode == 1 and "cargo build --release -p oocpt-bench" in done.stderr, done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_the_command_hands_on_flags_and_exit_statuses(installed):
    done = run(installed, "-m", "oocpt", "record", "--help")
    assert done.returncode == 0 and done.stdout.startswith("usage: oocpt record ") and "--samples N" in done.stdout
    assert run(installed, "-m", "oocpt", "record", "--no-such-flag").returncode == 2
    assert run(installed, "-m", "oocpt", "no-such-command").returncode == 2
