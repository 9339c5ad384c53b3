# SPDX-License-Identifier: Apache-2.0
"""Run by Blender's own Python module: installs the extension as a user does, and plays the scenes that are named.

Arguments: the folder of Blender's module, the zip, a folder for pictures, names of functions below. Their answers go to
`answers.json` in that folder. Where a scene is rendered by Cycles, too, that picture has `cycles` in its name.
"""

import ctypes
import json
import math
import os
import pathlib
import re
import subprocess
import sys
import threading
import time
import types

blender, package, folder, *names = sys.argv[1:]
sys.path.insert(0, blender)
OUT = pathlib.Path(folder)

import bpy  # noqa: E402  which the path above leads to
import addon_utils  # noqa: E402, I001  which comes with it
import numpy as np  # noqa: E402
from materials import material  # noqa: E402


def install():
    addon_utils.enable("bl_pkg")
    bpy.ops.extensions.package_install_files(filepath=package, repo="user_default", enable_on_install=True)
    addon_utils.enable("cycles")


# ---- scenes ----


def empty(width, height, sky=(0.5, 0.5, 0.5), wide=6.0):
    """A scene of nothing but a sky, seen from above by an orthographic camera."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.render.engine = "OOCPT"
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.oocpt.samples, scene.oocpt.filter, scene.oocpt.max_bounces = 16, "box", 16
    scene.world = bpy.data.worlds.new("Sky")
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (*sky, 1.0)
    camera = put("Camera", bpy.data.cameras.new("Camera"), (0, 0, 10))
    camera.data.type, camera.data.ortho_scale = "ORTHO", wide
    scene.camera = camera
    return scene


def put(name, data, location=(0, 0, 0)):
    made = bpy.data.objects.new(name, data)
    made.location = location
    bpy.context.scene.collection.objects.link(made)
    return made


def dull(name, color):
    return material(name, Base_Color=(*color, 1.0), Specular_IOR_Level=0.0, Roughness=1.0)


def plane(dressed, size=2.0, location=(0, 0, 0)):
    bpy.ops.mesh.primitive_plane_add(size=size, location=location)
    bpy.context.object.data.materials.append(dressed)
    return bpy.context.object


def lamp(kind, location, energy, **values):
    light = bpy.data.lights.new(kind, kind)
    light.energy = energy
    for key, value in values.items():
        setattr(light, key, value)
    return put(kind, light, location)


def render(name, layers=False):
    image = bpy.context.scene.render.image_settings
    image.media_type = "MULTI_LAYER_IMAGE" if layers else "IMAGE"
    image.file_format, image.color_depth = "OPEN_EXR_MULTILAYER" if layers else "OPEN_EXR", "32"
    bpy.context.scene.render.filepath = str(OUT / f"{name}.exr")
    return list(bpy.ops.render.render(write_still=True))


def render_both(name, samples):
    scene = bpy.context.scene
    scene.oocpt.samples = scene.cycles.samples = samples
    answer = render(name)
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device, cycles.use_denoising, cycles.use_adaptive_sampling = "CPU", False, False
    cycles.pixel_filter_type, cycles.sample_clamp_indirect, cycles.blur_glossy = "BOX", 0.0, 0.0
    for kind in ("", "diffuse_", "glossy_", "transmission_"):
        setattr(cycles, f"{kind}max_bounces" if not kind else f"{kind}bounces", 16)
    render(f"{name}_cycles")
    scene.render.engine = "OOCPT"
    return answer


def render_directly(name):
    """Through Blender's other export, without a USD stage."""
    bpy.context.scene.oocpt.export = "HYDRA"
    return render(f"{name}_hydra")


# ---- what is asked ----


def lamps():
    """Five lamps over a floor, 20 apart: a tenth of each one's light reaches the others."""
    empty(100, 20, sky=(0, 0, 0), wide=100)
    plane(dull("Floor", (0.5, 0.5, 0.5)), size=200)
    lamp("POINT", (-40, 0, 6), 3000, shadow_soft_size=0.3)
    lamp("SPOT", (-20, 0, 6), 3000, spot_size=2.0, spot_blend=0.7)
    lamp("AREA", (0, 0, 6), 1500, shape="ELLIPSE", size=3.0, size_y=1.5, use_temperature=True, temperature=3000)
    lamp("AREA", (20, 0, 6), 1500, shape="RECTANGLE", size=3.0, size_y=0.5, exposure=0.5)
    lamp("POINT", (40, 0, 6), 3000, color=(0.2, 0.5, 1.0))
    return [render_both("lamps", 64), render_directly("lamps")]


def sun():
    scene = empty(16, 8, sky=(0.1, 0.2, 0.4))
    plane(dull("Floor", (0.5, 0.5, 0.5)), size=200)
    lamp("SUN", (0, 0, 5), 3.0, angle=0.2).rotation_euler = (0.7, 0.2, 0)
    return [render_both("sun", 64), scene.hydra.export_method, render_directly("sun")]


def looks():
    """Balls of principled materials under an even sky, on a floor."""
    empty(96, 32, sky=(0.4, 0.5, 0.7), wide=9)
    plane(dull("Floor", (0.6, 0.6, 0.6)), size=40, location=(0, 0, -1))
    dressed = (
        material("Plastic", Base_Color=(0.8, 0.1, 0.1, 1), Roughness=0.3),
        material("Metal", Base_Color=(0.9, 0.7, 0.3, 1), Metallic=1.0, Roughness=0.4),
        material("Glass", Base_Color=(1, 1, 1, 1), Transmission_Weight=1.0, Roughness=0.0, IOR=1.45),
        material("Glow", Base_Color=(0, 0, 0, 1), Emission_Color=(0.1, 1.0, 0.1, 1), Emission_Strength=1.5),
    )
    for at, one in enumerate(dressed):
        bpy.ops.mesh.primitive_uv_sphere_add(radius=0.9, location=(2.2 * at - 3.3, 0, 0), segments=48, ring_count=24)
        bpy.ops.object.shade_smooth()
        bpy.context.object.data.materials.append(one)
    return render_both("looks", 256)


def views():
    """Cubes on the points of a grid, by geometry nodes, through a lens that is shifted and out of focus."""
    scene = empty(48, 64)
    bpy.ops.mesh.primitive_cube_add(size=0.5)
    cube = bpy.context.object
    cube.data.materials.append(dull("Red", (0.8, 0.3, 0.1)))
    cube.hide_render = True
    bpy.ops.mesh.primitive_grid_add(size=8, x_subdivisions=6, y_subdivisions=6)
    tree = bpy.data.node_groups.new("Cubes", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    kinds = ("NodeGroupInput", "GeometryNodeInstanceOnPoints", "GeometryNodeObjectInfo", "NodeGroupOutput")
    start, place, source, end = (tree.nodes.new(kind) for kind in kinds)
    source.inputs["Object"].default_value, source.inputs["As Instance"].default_value = cube, True
    tree.links.new(start.outputs[0], place.inputs["Points"])
    tree.links.new(source.outputs["Geometry"], place.inputs["Instance"])
    tree.links.new(place.outputs["Instances"], end.inputs[0])
    bpy.context.object.modifiers.new("Cubes", "NODES").node_group = tree
    camera = scene.camera
    camera.location, camera.rotation_euler = (0, -9, 5), (1.05, 0, 0)
    camera.data.type, camera.data.lens, camera.data.shift_x, camera.data.shift_y = "PERSP", 35, 0.1, -0.05
    camera.data.dof.use_dof, camera.data.dof.focus_distance, camera.data.dof.aperture_fstop = True, 6.0, 0.3
    return render_both("views", 128)


def sky():
    """A mirror under a panorama of strength 2 that is turned, and under one that is not; what has no material."""
    scene = empty(32, 16, wide=4)
    pixels = np.ones((16, 32, 4), np.float32)
    pixels[..., 0], pixels[..., 1] = np.linspace(0, 1, 32)[None, :], np.linspace(0, 1, 16)[:, None]
    image = bpy.data.images.new("panorama", 32, 16, float_buffer=True)
    image.pixels.foreach_set(pixels.ravel())
    image.filepath_raw, image.file_format = str(OUT / "panorama.hdr"), "HDR"
    image.save()
    nodes, links = scene.world.node_tree.nodes, scene.world.node_tree.links
    panorama, mapping = nodes.new("ShaderNodeTexEnvironment"), nodes.new("ShaderNodeMapping")
    panorama.image = bpy.data.images.load(str(OUT / "panorama.hdr"))
    links.new(panorama.outputs["Color"], nodes["Background"].inputs["Color"])
    nodes["Background"].inputs["Strength"].default_value = 2.0
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.9, location=(-1, 0, 0), segments=64, ring_count=32)
    bpy.ops.object.shade_smooth()
    bpy.context.object.data.materials.append(material("Mirror", Metallic=1.0, Roughness=0.0, Base_Color=(1, 1, 1, 1)))
    bpy.ops.mesh.primitive_plane_add(size=2, location=(1, 0, 0))
    answer = render_both("sky", 64)
    turned = nodes.new("ShaderNodeTexCoord")
    links.new(turned.outputs["Generated"], mapping.inputs["Vector"])
    links.new(mapping.outputs["Vector"], panorama.inputs["Vector"])
    mapping.inputs["Rotation"].default_value = (0, 0, 1.0)
    return [answer, render_both("sky_turned", 64)]


def _glowing(name, kind, at):
    """The node that gives the `at`-th plane its colour."""
    made = material(name, Base_Color=(0, 0, 0, 1), Specular_IOR_Level=0.0, Emission_Strength=1.0)
    node = made.node_tree.nodes.new(kind)
    glow = made.node_tree.nodes["Principled BSDF"].inputs["Emission Color"]
    made.node_tree.links.new(node.outputs["Color"], glow)
    plane(made, location=(2 * at - 4, 0, 0))
    return node


def textures():
    """Planes that glow in the colours of a file, a packed file whose name is gone, a packed picture, a painted one, of
    the mesh itself."""
    empty(80, 16, sky=(0, 0, 0), wide=10)
    for at, kind in enumerate(("file", "packed_file", "packed", "painted")):
        image = bpy.data.images.new(f"{kind} image", 8, 8)
        image.pixels.foreach_set(np.tile(np.array([0.75, 0.5, 0.1 + 0.2 * at, 1], np.float32), 64))
        if "file" in kind:
            image.filepath_raw, image.file_format = str(OUT / f"{kind}.png"), "PNG"
            image.save()
            bpy.data.images.remove(image)
            image = bpy.data.images.load(str(OUT / f"{kind}.png"))
        if "packed" in kind:
            image.pack()
        if kind == "packed_file":
            image.name = "Renamed"
            (OUT / "packed_file.png").unlink()
        _glowing(kind, "ShaderNodeTexImage", at).image = image
    _glowing("attribute", "ShaderNodeVertexColor", 4).layer_name = "Tint"
    tint = bpy.context.object.data.color_attributes.new("Tint", "FLOAT_COLOR", "CORNER")
    for corner, color in zip(tint.data, ((0.9, 0, 0.9, 1), (0, 0.9, 0.9, 1)) * 2, strict=True):
        corner.color = color
    return render_both("textures", 16)


def hair():
    """Strands of a hair object and of a particle system, of both one that narrows, before a clear background."""
    scene = empty(64, 32, wide=8)
    scene.render.film_transparent = True
    curves = bpy.data.hair_curves.new("Strands")
    curves.add_curves([5] * 3)
    points = [(x + 0.1 * k * k / 16, 0.7 * k - 1.4, 0) for x in (-3, -2, -1) for k in range(5)]
    curves.position_data.foreach_set("vector", np.array(points, np.float32).ravel())
    curves.attributes.new("radius", "FLOAT", "POINT")
    curves.attributes["radius"].data.foreach_set("value", np.array([0.2, 0.2, 0.2, 0.15, 0.1] * 3, np.float32))
    curves.materials.append(dull("Red", (0.8, 0.05, 0.05)))
    put("Strands", curves)
    ground = plane(dull("Ground", (0.1, 0.1, 0.1)), size=0.02, location=(2, 0, -2))
    ground.data.materials.append(dull("Green", (0.05, 0.8, 0.05)))
    ground.modifiers.new("Grass", "PARTICLE_SYSTEM")
    grass = ground.particle_systems[0].settings
    grass.type, grass.count, grass.hair_length, grass.material = "HAIR", 1, 1.5, 2
    grass.root_radius, grass.tip_radius, grass.radius_scale, grass.use_close_tip = 1.0, 0.5, 0.2, False
    ground.rotation_euler = (-math.pi / 2, 0, 0)
    return render_both("hair", 64)


def links():
    """Two floors, and a lamp that is linked to the left one alone; one that reaches all but the left one."""
    empty(32, 16, sky=(0, 0, 0), wide=8)
    floors = [plane(dull(name, (0.5, 0.5, 0.5)), size=4, location=(x, 0, 0)) for name, x in (("L", -2), ("R", 2))]
    for at, state in enumerate(("INCLUDE", "EXCLUDE")):
        source = lamp("SUN", (0, 0, 5), 1.0, color=(1, 0, 0) if at == 0 else (0, 0, 1))
        chosen = bpy.data.collections.new(f"Chosen{at}")
        chosen.objects.link(floors[0])
        chosen.collection_objects[0].light_linking.link_state = state
        source.light_linking.receiver_collection = chosen
    linked = render_both("links", 16)
    bpy.context.scene.oocpt.light_linking = False
    return [linked, render("links_off")]


def film():
    """All passes; then what is there where nothing is seen."""
    scene = empty(48, 32)
    scene.oocpt.samples = 4
    plane(dull("Red", (0.8, 0.1, 0.1)), location=(-1, 0, 1))
    layer = bpy.context.view_layer
    ours = [one.identifier for one in layer.oocpt.bl_rna.properties if one.identifier.startswith("use_")]
    for name in ("use_pass_z", "use_pass_normal", "use_pass_position"):
        setattr(layer, name, True)
    for name in ours:
        setattr(layer.oocpt, name, name != "use_denoised")
    answers = [ours, render("passes", layers=True)]
    for name in ours:
        setattr(layer.oocpt, name, False)
    scene.render.film_transparent = True
    answers.append(render("transparent"))
    scene.render.film_transparent, scene.world = False, None
    scene.render.use_border = scene.render.use_crop_to_border = True
    scene.render.border_max_x = scene.render.border_max_y = 0.5
    return [*answers, render("no_world")]


def unseen():
    """A shadow catcher half below a roof behind the camera, and a holdout, under a sun."""
    scene = empty(32, 16, sky=(0, 0, 0), wide=8)
    floors = [plane(dull(name, (0.5, 0.5, 0.5)), size=4, location=(x, 0, 0)) for name, x in (("L", -2), ("R", 2))]
    floors[0].is_shadow_catcher = floors[1].is_holdout = True
    plane(dull("Roof", (0.5, 0.5, 0.5)), size=8, location=(-6, 0, 12))
    lamp("SUN", (0, 0, 15), 1.0)
    scene.render.film_transparent = True
    return render_both("unseen", 64)


def edits():
    """A cube that moves, of instances of a collection, in three frames; then in another colour, then gone."""
    scene = empty(48, 16)
    bpy.ops.mesh.primitive_cube_add(size=1)
    cube = bpy.context.object
    glow = material("Glow", Base_Color=(0, 0, 0, 1), Specular_IOR_Level=0.0, Emission_Color=(1, 0, 0, 1),
                    Emission_Strength=1.0)  # fmt: skip
    cube.data.materials.append(glow)
    cubes = bpy.data.collections.new("Cubes")
    scene.collection.objects.unlink(cube)
    cubes.objects.link(cube)
    places = [put(f"Place{k}", None, (3 * k - 1.5, 0, 0)) for k in range(2)]
    for place in places:
        place.instance_type, place.instance_collection = "COLLECTION", cubes
    for frame in (1, 2, 3):
        places[0].location[0] = -3.5 + frame
        places[0].keyframe_insert("location", frame=frame)
    scene.frame_start, scene.frame_end = 1, 3
    image = scene.render.image_settings
    image.file_format, image.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = str(OUT / "frame_##")
    answers = [list(bpy.ops.render.render(animation=True))]
    glow.node_tree.nodes["Principled BSDF"].inputs["Emission Color"].default_value = (0, 0, 1, 1)
    answers.append(render("recoloured"))
    places[1].hide_render = True
    return [*answers, render("hidden")]


# ---- what is set ----


class RecordedLayout:
    """Stands for Blender's layout, which only a window has: takes what panels put into it, and knows what exists."""

    def __init__(self):
        self.shown = set()

    def prop(self, data, name, **_):
        assert name in data.bl_rna.properties, f"{data} has no {name}"
        self.shown.add(name)

    def row(self, **_):
        return self

    column = row


def panels():
    """Draws each panel for each kind of light; what they show, and which of Blender's own hold for the engine."""
    made = sys.modules["bl_ext.user_default.oocpt.panels"]
    layout, scene = RecordedLayout(), empty(8, 8)
    for kind in ("POINT", "SPOT", "SUN", "AREA"):
        light = bpy.data.lights.new(kind, kind)
        if kind == "AREA":
            light.shape = "ELLIPSE"
        context = types.SimpleNamespace(scene=scene, view_layer=bpy.context.view_layer, light=light, engine="OOCPT")
        for panel in made.CLASSES:
            assert panel.poll(context)
            panel.draw_rows(types.SimpleNamespace(_draw_shape=lambda *given: panel._draw_shape(None, *given)),
                            layout, context)  # fmt: skip
    everywhere = bpy.types.Panel.__subclasses__()
    registered = {one.__name__ for one in everywhere if "OOCPT" in getattr(one, "COMPAT_ENGINES", ())}
    ours = {one.identifier for one in scene.oocpt.bl_rna.properties} - {"rna_type", "name"}
    return {"missing": sorted(ours - layout.shown), "shown": sorted(layout.shown), "panels": sorted(registered)}


def chosen():
    """What the delegate is given, for a picture and for a viewport."""
    scene, made = empty(8, 8), sys.modules["bl_ext.user_default.oocpt.settings"]
    scene.oocpt.samples, scene.oocpt.viewport_samples, scene.oocpt.time_limit = 100, 10, 60
    scene.oocpt.seed, scene.oocpt.animate_seed, scene.oocpt.denoise = 5, True, "final"
    scene.frame_set(7)
    made.preferences().memory = 9000
    layer = bpy.context.view_layer
    given = {use: made.for_hydra(scene, layer, use, f"report of {use}") for use in ("FINAL", "VIEWPORT", "PREVIEW")}
    made.preferences().memory = 0
    return given


# ---- what goes wrong ----


def _attempt(name):
    """What the operator says, in its own words, and whether a picture was written."""
    try:
        answer = render(name)
    except RuntimeError as error:
        answer = str(error)
    return [answer, (OUT / f"{name}.exr").exists()]


def faults():
    """Each is told, and the next picture is none the worse."""
    scene = empty(32, 16)
    plane(dull("Red", (0.8, 0.1, 0.1)))
    scene.camera.data.type = "PANO"
    answers = {"panorama": _attempt("panorama")}
    scene.camera.data.type = "ORTHO"
    preferences = bpy.context.preferences.addons["bl_ext.user_default.oocpt"].preferences
    preferences.memory = 1
    answers["memory"] = _attempt("memory")
    preferences.memory, preferences.device = 0, "no such device"
    answers["device"] = _attempt("device")
    preferences.device = ""
    made = sys.modules["bl_ext.user_default.oocpt.stage"]
    dress, made._dress_particles = made._dress_particles, None
    answers["correction"] = _attempt("correction")
    made._dress_particles = dress
    camera, scene.camera = scene.camera, None
    answers["camera"] = _attempt("camera")
    scene.camera = camera
    scene.render.use_motion_blur = True
    answers["after"] = _attempt("after")
    return answers


def attempt():
    """A picture where plugin or driver may be missing."""
    empty(16, 16)
    return _attempt("attempt")


def _break_flag():
    """Where Blender notes that the user wants to stop: `G.is_break`, which only keys of a window set."""
    library = str(pathlib.Path(blender) / "bpy/__init__.so")
    symbols = subprocess.run(["nm", library], check=True, capture_output=True, text=True).stdout
    # In a namespace since 5.2.
    offset = int(re.search(r"^(\w+) b (?:G|_ZN7blender1GE)$", symbols, re.MULTILINE)[1], 16)
    maps = pathlib.Path("/proc/self/maps").read_text()
    start = int(re.search(rf"^(\w+)-\w+ \S+ 00000000 .*{re.escape(library)}$", maps, re.MULTILINE)[1], 16)
    return ctypes.c_bool.from_address(start + offset + 0xC20)


def cancel():
    """Stops a picture that would take hours, once it is under way. Counts how often Blender asked meanwhile."""
    scene = empty(320, 240)
    scene.oocpt.samples = 1 << 20
    bpy.ops.mesh.primitive_monkey_add(size=3)
    engine = sys.modules["bl_ext.user_default.oocpt.engine"].OocPTRenderEngine
    flag, seen, show = _break_flag(), [], engine._show
    stopped = threading.Event()

    def watch(self, share, text):
        seen.append((share, text))
        if "relMSE" in text and not stopped.is_set():
            # The engine sees what a key sets: else the offset is not that of this Blender.
            assert not flag.value and not self.test_break()
            flag.value = True
            assert self.test_break()
            stopped.at = time.monotonic()
            stopped.set()
        show(self, share, text)

    engine._show = watch
    try:
        answer = _attempt("cancelled")
    finally:
        engine._show = show
    held = time.monotonic() - stopped.at
    flag.value = False
    scene.oocpt.samples = 4
    return {"answer": answer, "seen": seen[-1], "seconds": held, "after": _attempt("after_cancel")}


def _held():
    status = pathlib.Path("/proc/self/status").read_text()
    resident = int(re.search(r"VmRSS:\s+(\d+) kB", status)[1]) // 1024
    threads, files = (len(os.listdir(f"/proc/self/{kind}")) for kind in ("task", "fd"))
    return {"resident": resident, "threads": threads, "files": files}


def starts():
    """50 pictures, an engine each."""
    scene = empty(16, 16)
    scene.oocpt.samples = 1
    plane(dull("Red", (0.8, 0.1, 0.1)))
    for _ in range(10):
        render("started")
    before = _held()
    for _ in range(50):
        render("started")
    return [before, _held()]


install()
answers = {}
for name in names:
    answers[name] = globals()[name]()
    (OUT / "answers.json").write_text(json.dumps(answers))
