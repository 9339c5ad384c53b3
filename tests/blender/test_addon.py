# SPDX-License-Identifier: Apache-2.0
"""The Blender extension as a user has it: packed from what was built, installed from the zip by Blender itself, used in
a Blender without a window. Pictures are compared with Cycles' of the same scenes, region by region."""

import json
import os
import pathlib
import subprocess
import sys
import zipfile

import numpy as np
import OpenImageIO as oiio
import pytest

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = pathlib.Path(__file__).resolve().parent / "addon_process.py"
# Largest difference of a region's mean from Cycles', and what both leave to noise where next to nothing is seen.
SHARE, LEAST = 0.02, 0.002
SCENES = ("panels", "chosen", "lamps", "sun", "looks", "views", "sky", "textures", "hair", "links", "film", "unseen",
          "edits", "faults", "cancel", "starts")  # fmt: skip


def of_the_host():
    """Which Blender and which OpenUSD the plugin in the environment was built for."""
    root = pathlib.Path(os.environ["OOCPT_HOST_ROOT"])
    (installed,) = (root / "python").glob("bpy-*.dist-info")
    return ["--openusd", root.name.removeprefix("host-"), "--bpy", installed.stem.removeprefix("bpy-")]


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    """`OOCPT_BLENDER_ZIP` is one that was packed on another system."""
    if ready := os.environ.get("OOCPT_BLENDER_ZIP"):
        return pathlib.Path(ready)
    command = [sys.executable, "-I", REPOSITORY / "plugin/blender/pack.py", "--out", tmp_path_factory.mktemp("dist")]
    command += ["--plugin", f"{os.environ['OOCPT_BUILD']}/plugin", *of_the_host()]
    done = subprocess.run(command, capture_output=True, text=True, check=False, start_new_session=True)
    assert done.returncode == 0, done.stderr
    return pathlib.Path(done.stdout.strip())


@pytest.fixture(scope="module")
def run(blender, package, variables, tmp_path_factory):
    """Plays scenes in a Blender that has nothing of its user's; gives the folder of pictures, and the answers."""

    def play(*names, package=package, **more):
        folder = tmp_path_factory.mktemp("pictures")
        environment = {**variables, "BLENDER_USER_RESOURCES": str(tmp_path_factory.mktemp("user")), **more}
        command = [os.environ["OOCPT_HOST_PYTHON"], "-W", "ignore", PROGRAM, blender, package, folder, *names]
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=600, check=False, start_new_session=True
        )
        said = done.stdout + done.stderr
        assert done.returncode == 0, f"{done.returncode}: {said[-5000:]}"
        return folder, json.loads((folder / "answers.json").read_text()), said

    return play


@pytest.fixture(scope="module")
def played(run):
    return run(*SCENES)


def picture(folder, name):
    return oiio.ImageInput.open(str(folder / f"{name}.exr")).read_image("float")


def regions(folder, name, columns, rows=1):
    """Means of regions of our picture and of Cycles', as (row, column, channel)."""
    means = []
    for one in (name, f"{name}_cycles"):
        pixels = picture(folder, one)
        height, width, channels = pixels.shape
        blocks = pixels.reshape(rows, height // rows, columns, width // columns, channels)
        means.append(blocks.mean(axis=(1, 3)))
    return means


def close(ours, cycles, what):
    off = np.abs(ours - cycles) - SHARE * np.abs(cycles)
    assert (off < LEAST).all(), f"{what}: {ours.round(4).tolist()}, Cycles {cycles.round(4).tolist()}"


# ---- the zip ----


def test_the_zip_holds_what_is_needed_and_no_date(package):
    with zipfile.ZipFile(package) as archive:
        entries = archive.infolist()
        contents = {entry.filename: archive.read(entry) for entry in entries}
    names = [entry.filename for entry in entries]
    assert names == sorted(names) and all(entry.date_time == (1980, 1, 1, 0, 0, 0) for entry in entries)
    needed = {"__init__.py", "blender_manifest.toml", "LICENSE", "plugin/hdOocPT.so", "plugin/hdOocPTImages.so",
              "plugin/hdOocPT/resources/plugInfo.json", "plugin/hdOocPT/lib/libOpenImageIO.so.2.4"}  # fmt: skip
    assert needed <= set(names), names
    beside = {name for name in names if not name.startswith(("plugin/", "licenses/")) and name not in needed}
    assert all(name.endswith(".py") and "/" not in name for name in beside), beside
    assert not any("pycache" in name or name.endswith(("/pack.py", ".a")) for name in names)
    built = pathlib.Path(os.environ["OOCPT_BUILD"]) / "plugin/hdOocPT.so"
    assert len(contents["plugin/hdOocPT.so"]) < 0.9 * built.stat().st_size, "without what debuggers read"
    assert package.stat().st_size < 30 << 20
    for folder in (REPOSITORY, os.environ["OOCPT_HOST_ROOT"], pathlib.Path.home() / ".cargo"):
        assert not [name for name, content in contents.items() if f"{folder}/".encode() in content], folder


def test_blender_finds_no_fault_with_the_zip(package, blender):
    (judge,) = blender.glob("bpy/5.*/scripts/addons_core/bl_pkg/cli/blender_ext.py")
    command = [os.environ["OOCPT_HOST_PYTHON"], "-I", judge, "validate", package]
    done = subprocess.run(command, capture_output=True, text=True, check=False, start_new_session=True)
    assert done.returncode == 0 and "Success" in done.stdout, done.stdout + done.stderr


# ---- what is set ----


def test_panels_show_every_setting_and_only_what_exists(played):
    panels = played[1]["panels"]
    assert panels["missing"] == []
    shown = {"use_pass_z", "use_prim_id", "film_transparent", "viewport_memory", "spot_blend", "size_y", "angle"}
    assert shown <= set(panels["shown"]), panels["shown"]
    of_blender = {"RENDER_PT_format", "RENDER_PT_color_management", "EEVEE_MATERIAL_PT_surface", "DATA_PT_lens",
                  "WORLD_PT_context_world", "EEVEE_WORLD_PT_surface", "DATA_PT_camera_dof",
                  "OBJECT_PT_shading"}  # fmt: skip
    assert of_blender <= set(panels["panels"]), panels["panels"]
    assert not [name for name in panels["panels"] if "freestyle" in name or "simplify" in name]


def test_the_delegate_is_given_what_is_chosen(played):
    given = played[1]["chosen"]
    final, viewport, preview = (given[use] for use in ("FINAL", "VIEWPORT", "PREVIEW"))
    samples = [one["oocpt:samplesPerPixel"] for one in (final, viewport, preview)]
    assert samples == [100, 10, 10]
    assert final["oocpt:seed"] == 12 and final["oocpt:denoise"] == "final" and final["oocpt:timeLimit"] == 60
    assert viewport["oocpt:timeLimit"] == 0 and viewport["oocpt:denoise"] == "off"
    assert (final["oocpt:memoryBudget"], viewport["oocpt:memoryBudget"]) == (9000, 4096), "a viewport leaves room"
    assert "oocpt:device" not in final, "what is not chosen is left to the environment"
    assert viewport["enableInteractive"] and not final["enableInteractive"], "nobody looks on"
    assert final["aovToken:Combined"] == "color" and not [key for key in viewport if key.startswith("aovToken")]
    assert final["oocpt:report"] == "report of FINAL"


# ---- pictures beside Cycles' ----


def test_lamps_light_as_much_as_in_cycles(played):
    folder, answers, _ = played
    assert answers["lamps"] == [["FINISHED"]] * 2
    ours, cycles = regions(folder, "lamps", columns=5)
    assert (ours[..., :3].max(axis=2) > 0.25).all(), "each lamp lights its part"
    close(ours, cycles, "floor below point, spot, ellipse, rectangle, coloured point")


def test_a_sun_is_as_strong_and_the_export_is_left_to_the_user(played):
    folder, answers, _ = played
    close(*regions(folder, "sun", columns=2), "floor in the sun")
    assert answers["sun"] == [["FINISHED"], "HYDRA", ["FINISHED"]], "Blender's own choice, which other engines read"


def test_suns_and_spots_shine_through_the_other_export_too(played):
    folder, *_ = played
    for name, columns in (("sun", 2), ("lamps", 5)):
        blocks = [picture(folder, f"{name}_{way}") for way in ("hydra", "cycles")]
        means = [np.split(pixels, columns, axis=1) for pixels in blocks]
        ours, cycles = (np.array([block.mean(axis=(0, 1)) for block in split]) for split in means)
        if name == "sun":
            close(ours, cycles, "floor in the sun")
        else:
            # Of the first lamp the camera sees the bulb; the ellipse is a disk.
            close(ours[[1, 3, 4]], cycles[[1, 3, 4]], "spot, rectangle, coloured point")


def test_materials_look_as_in_cycles(played):
    folder, *_ = played
    ours, cycles = regions(folder, "looks", columns=8, rows=2)
    close(ours, cycles, "plastic, metal, glass, glow")
    # Behind clear glass is a floor in its own shade: neither black nor a mirror of the sky.
    assert (np.abs(ours[:, 4:6] - ours[:, :1]).max(axis=2) > 0.05).all()


def test_lenses_and_instances_of_geometry_nodes_are_those_of_cycles(played):
    folder, *_ = played
    ours, cycles = regions(folder, "views", columns=6, rows=8)
    close(ours, cycles, "blurred cubes")
    assert np.ptp(ours[..., 2]) > 0.2, "cubes and sky"


@pytest.mark.parametrize("name", ["sky", "sky_turned"])
def test_a_sky_is_as_bright_and_where_it_is_in_cycles(played, name):
    folder, *_ = played
    # The camera looks at the pole, where a panorama has no colour: what is seen directly is not compared.
    ours, cycles = regions(folder, name, columns=8, rows=4)
    close(ours[1:3, 1:3], cycles[1:3, 1:3], "quarters of a mirror")
    np.testing.assert_allclose(ours[1:3, 5:7], cycles[1:3, 5:7], rtol=0.03, err_msg="without a material")
    mirrored = ours[1:3, 1:3, :2]
    assert mirrored.std(axis=1)[..., 0].min() > 0.1, f"each side another: {mirrored}"


def test_textures_are_found_where_no_file_is(played):
    folder, _, said = played
    ours, cycles = regions(folder, "textures", columns=20)
    close(ours, cycles, "file, packed file, packed image, painted image, attribute of the mesh")
    tint = ours[0, 16:]
    assert tint[:, 0].min() > 0.3 and tint[:, 2].min() > 0.8 and (np.ptp(tint[:, 1]) > 0.1), f"the attribute: {tint}"
    ours = ours[:, :16].reshape(1, 4, 4, -1).mean(axis=2)
    assert (np.diff(ours[0, :, 2]) > 0.05).all(), f"each its own: {ours[0]}"
    assert "was not found" not in said


def test_hair_has_the_width_and_colour_of_cycles(played):
    folder, *_ = played
    # Ends are round here and flat in Cycles.
    ours, cycles = (picture(folder, name) for name in ("hair", "hair_cycles"))
    for left in (4, 12, 20):
        strand = (slice(8, 24), slice(left, left + 8))
        close(ours[strand].mean(axis=(0, 1)), cycles[strand].mean(axis=(0, 1)), f"strand of hair at {left}")
    grass = (slice(5, 15), slice(44, 52))
    ours, cycles = ours[grass].mean(axis=(0, 1)), cycles[grass].mean(axis=(0, 1))
    assert ours[1] > 5 * ours[0] and abs(ours[3] / cycles[3] - 1) < 0.1, f"hair of particles: {ours}, {cycles}"


def test_lights_reach_what_they_are_linked_to(played):
    folder, *_ = played
    ours, cycles = regions(folder, "links", columns=2)
    close(ours, cycles, "floors with links")
    assert ours[0, 0, 2] == 0 == ours[0, 1, 0]
    unlinked = picture(folder, "links_off").mean(axis=(0, 1))
    assert unlinked[0] > 0.1 and unlinked[2] > 0.1, f"without links each lights all: {unlinked}"


# ---- passes, film, edits ----


def passes_of(file):
    """Pixels by name of pass. Blender writes a part for each."""
    found, reader, part = {}, oiio.ImageInput.open(str(file)), 0
    attributes = {one.name: one.value for one in reader.spec().extra_attribs}
    while reader.seek_subimage(part, 0):
        spec = reader.spec()
        name = spec.channelnames[0].split(".")[1]
        found[name] = reader.read_image(part, 0, 0, spec.nchannels, "float")
        part += 1
    return found, attributes


def test_passes_hold_what_they_are_named_for(played):
    folder, answers, _ = played
    found, attributes = passes_of(folder / "passes.exr")
    plane, sky = (16, 16), (2, 2)
    numbers = {name: (pixels[plane].tolist(), pixels[sky].tolist()) for name, pixels in found.items()}
    assert numbers["Depth"] == ([9.0], [np.float32(1e10)])
    for name in ("Normal", "Geometric Normal"):
        assert numbers[name] == ([0, 0, 1], [0, 0, 0])
    np.testing.assert_allclose(found["Position"][plane], [-0.9375, -0.0625, 1.0], atol=0.07)
    np.testing.assert_allclose(found["Albedo"][plane], [0.8, 0.1, 0.1], atol=1e-3)
    assert numbers["Prim ID"] == ([0.0], [-1.0]) and numbers["Instance ID"] == ([0.0], [-1.0])
    assert numbers["Sample Count"] == ([4.0], [4.0])
    assert numbers["Error"][0][0] > 0 == numbers["Error"][1][0] and numbers["Variance"][0][0] > 0
    assert len(found) == 4 + len(answers["film"][0]) - 1, f"all but the denoised one: {list(found)}"
    assert attributes["oocpt:samples"] == "4" and float(attributes["oocpt:relMse"]) > 0


def test_the_film_is_clear_where_it_shall_be(played):
    folder, *_ = played
    clear = picture(folder, "transparent")
    assert clear[2, 2].tolist() == [0, 0, 0, 0] and clear[16, 16, 3] == 1
    bare = picture(folder, "no_world")
    assert bare.shape == (16, 24, 4), "the border alone"
    assert (bare[..., 3] == 1).all() and bare[..., :3].max() < 1e-10, "black and opaque, as in Blender"


def test_catchers_and_holdouts_are_those_of_cycles(played):
    folder, *_ = played
    ours, cycles = regions(folder, "unseen", columns=4)
    np.testing.assert_allclose(ours[0], [[0, 0, 0, 1], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]], atol=0.05)
    close(ours, cycles, "a catcher in shadow and in light, a holdout")


def test_frames_and_edits_show_the_scene_as_it_is_then(played):
    folder, answers, _ = played
    assert answers["edits"] == [["FINISHED"]] * 3
    shown = {}
    for name in ("frame_01", "frame_02", "frame_03", "recoloured", "hidden"):
        pixels = picture(folder, name)[8]
        red, blue = (pixels[:, at] > 0.9 for at in (0, 2))
        glows = (red | blue) & (pixels[:, 1] < 0.1)
        shown[name] = (np.flatnonzero(glows & red).tolist(), np.flatnonzero(glows & blue).tolist())
    still = list(range(32, 40))
    for frame in (1, 2, 3):
        moved = list(range(8 * frame - 8, 8 * frame))
        assert shown[f"frame_0{frame}"] == (moved + still, []), f"frame {frame}"
    assert shown["recoloured"] == ([], [*range(8), *still]) and shown["hidden"] == ([], [*range(8)])


# ---- what goes wrong ----


def test_what_cannot_be_rendered_is_told_and_never_finished(played):
    _, answers, said = played
    faults = answers["faults"]
    words = {"panorama": "panoramic", "memory": "memory budget of 1 MiB is too small", "device": "llvmpipe",
             "correction": "could not be corrected: TypeError", "camera": "no camera"}  # fmt: skip
    for name, part in words.items():
        answer, is_written = faults[name]
        assert part in answer and not is_written, f"{name}: {faults[name]}"
    assert faults["after"] == [["FINISHED"], True], "and the next picture is none the worse"
    assert "no motion blur" in said


def test_a_picture_is_cancelled_at_once(played):
    _, answers, _ = played
    cancelled = answers["cancel"]
    assert cancelled["answer"] == [["CANCELLED"], False] and cancelled["after"] == [["FINISHED"], True]
    share, text = cancelled["seen"]
    assert 0 < share < 0.01 and "/ 1048576 samples | relMSE" in text, text


def test_engines_leave_nothing_behind(played):
    before, after = played[1]["starts"]
    # Measured: 0 MB, no thread and no file in 50 pictures.
    assert after["resident"] <= before["resident"] + 16, f"{before}, then {after}"
    assert after["threads"] <= before["threads"] + 1 and after["files"] <= before["files"] + 1, f"{before}, {after}"


def test_a_missing_driver_is_told(run):
    _, answers, _ = run("attempt", VK_DRIVER_FILES="/nonexistent", VK_ICD_FILENAMES="/nonexistent")
    answer, is_written = answers["attempt"]
    assert "no Vulkan driver is installed" in answer and not is_written, answers


def test_a_missing_plugin_is_told(run, package, tmp_path):
    crippled = tmp_path / "crippled.zip"
    with zipfile.ZipFile(package) as whole, zipfile.ZipFile(crippled, "w", zipfile.ZIP_DEFLATED) as part:
        for entry in whole.infolist():
            if entry.filename != "plugin/hdOocPT.so":
                part.writestr(entry, whole.read(entry))
    _, answers, _ = run("attempt", package=crippled)
    answer, is_written = answers["attempt"]
    assert "install the extension again" in answer and not is_written, answers
