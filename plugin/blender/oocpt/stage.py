# SPDX-License-Identifier: Apache-2.0
"""Corrects the USD stage that Blender exports for OocPT: what Blender's exporter leaves out or states otherwise
than USD defines it. A `USDHook`, which Blender calls at the end of every export, and which leaves those alone that are
not for this engine."""

import contextlib
import math
import threading

import bpy

from . import materials, pins

# Blender divides the strength of suns by 4, and halves their angle.
SUN_STRENGTH, SUN_ANGLE = 4.0, 2.0
# Turns USD's frame of a sky, whose middle is at z and whose top is y, into Blender's, -x and z.
SKY_TURN = (90.0, 0.0, 90.0)
# What Blender's own engines give to what has no material.
BARE_COLOR = (0.8, 0.8, 0.8)
# Below what a picture of floats can show beside anything else.
NO_LIGHT = 1e-20
CAMERA_VISIBILITY = "ri:attributes:visibility:camera"
# Of objects, and the primvars that mean the same.
UNSEEN = (("is_shadow_catcher", "oocpt:shadowCatcher"), ("is_holdout", "oocpt:matte"))
# Names of Blender's data, on the prims that are made of them.
OBJECT_NAME, DATA_NAME = "userProperties:blender:object_name", "userProperties:blender:data_name"
# By thread: a viewport may export while a picture does.
_export = threading.local()


@contextlib.contextmanager
def exporting(depsgraph, is_transparent):
    """What is exported within is for this engine; a background that the camera sees through has no sky put into it.
    Gives a list that holds what went wrong."""
    faults = []
    _export.scene = depsgraph, is_transparent, faults
    try:
        yield faults
    finally:
        _export.scene = None


@contextlib.contextmanager
def lights_as_they_are(depsgraph):
    """What is exported to Hydra without a stage is corrected where it is read: in the scene of this frame, for as long
    as it is read."""
    lights = []
    if depsgraph.scene_eval.hydra.export_method == "HYDRA":
        lights = [one for one in depsgraph.ids if isinstance(one, bpy.types.Light) and one.type in {"SUN", "SPOT"}]
    kept = [(one, one.energy, one.angle if one.type == "SUN" else one.spot_blend) for one in lights]
    for one in lights:
        if one.type == "SUN":
            one.energy, one.angle = one.energy * SUN_STRENGTH, one.angle * SUN_ANGLE
        else:
            one.spot_blend = _softness(one)
    try:
        yield
    finally:
        for one, energy, value in kept:
            one.energy = energy
            setattr(one, "angle" if one.type == "SUN" else "spot_blend", value)


class OocPTStageHook(bpy.types.USDHook):
    bl_idname = "oocpt_stage_hook"
    bl_label = "OocPT"

    @staticmethod
    def on_export(export_context):
        scene = getattr(_export, "scene", None)
        if scene is None:
            return False
        depsgraph, is_transparent, faults = scene
        try:
            correct(export_context.get_stage(), depsgraph, is_transparent)
        except Exception as error:  # noqa: BLE001  Blender would print it and render what is not corrected
            faults.append(f"the exported scene could not be corrected: {type(error).__name__}: {error}")
        return True


def correct(stage, depsgraph, is_transparent):
    prims = PrimsByType(stage)
    data = EvaluatedData(depsgraph)
    lights = prims.of(*LIGHT_TYPES)
    for prim in lights:
        _correct_light(prim, data)
    skies = prims.of("DomeLight")
    for prim in skies:
        _correct_sky(prim, depsgraph.scene_eval.world)
    if depsgraph.scene.oocpt.light_linking:
        _link_lights(lights, prims, data)
    _dress_particles(prims, data)
    _color_bare(prims)
    _mark_unseen(prims, data)
    materials.connect_color_attributes(prims.of("Shader"), data)
    materials.correct(prims.of("Shader", "DomeLight"), data)
    if not is_transparent and not any(_is_seen_as_sky(prim) for prim in skies):
        _blacken(stage)


class PrimsByType:
    """The prims of a stage, which may have a transform for each of many instances."""

    def __init__(self, stage):
        self._tables = {}
        for prim in stage.TraverseAll():
            self._tables.setdefault(prim.GetTypeName(), []).append(prim)

    def of(self, *types):
        return [prim for one in types for prim in self._tables.get(one, ())]

    def __iter__(self):
        return (prim for table in self._tables.values() for prim in table)


class EvaluatedData:
    """Blender's data as it is in this frame, by name."""

    def __init__(self, depsgraph):
        self.lights, self.objects, self.materials, self.images = {}, {}, {}, {}
        kinds = ((bpy.types.Light, self.lights), (bpy.types.Object, self.objects),
                 (bpy.types.Material, self.materials), (bpy.types.Image, self.images))  # fmt: skip
        for one in depsgraph.ids:
            for kind, table in kinds:
                if isinstance(one, kind):
                    table[one.name] = one

    def object_of(self, prim):
        """The object that a prim, or the transform above it, is made of."""
        return self.objects.get(text_of(prim, OBJECT_NAME) or text_of(prim.GetParent(), OBJECT_NAME))


def text_of(prim, attribute):
    return prim.GetAttribute(attribute).Get() if prim and prim.HasAttribute(attribute) else None


# ---- lights ----

LIGHT_TYPES = ("SphereLight", "DistantLight", "RectLight", "DiskLight", "CylinderLight")


def _correct_light(prim, data):
    from pxr import Sdf, UsdGeom, UsdLux

    light, owner = data.lights.get(text_of(prim, DATA_NAME)), data.object_of(prim)
    if light is None:
        return
    api = UsdLux.LightAPI(prim)
    # The exporter always turns it on, and 6500 K are not white.
    api.CreateEnableColorTemperatureAttr(light.use_temperature)
    if light.type == "SUN":
        _scale(api.CreateIntensityAttr(), SUN_STRENGTH)
        _scale(UsdLux.DistantLight(prim).CreateAngleAttr(), SUN_ANGLE)
    if light.type == "SPOT":
        _shape_cone(prim, light)
    if not light.use_shadow:
        UsdLux.ShadowAPI.Apply(prim).CreateShadowEnableAttr(False)
    if owner is None or not owner.visible_camera:
        seen = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(CAMERA_VISIBILITY, Sdf.ValueTypeNames.Bool)
        seen.Set(False)


def _scale(attribute, factor):
    attribute.Set(attribute.Get() * factor)


def _shape_cone(prim, light):
    from pxr import UsdLux

    shaping = UsdLux.ShapingAPI.Apply(prim)
    shaping.CreateShapingConeAngleAttr(math.degrees(light.spot_size / 2))
    shaping.CreateShapingConeSoftnessAttr(_softness(light))


def _softness(light):
    """Blender's spots fade over the cosine of the angle, USD's over the angle: the softness with as much light."""
    half = light.spot_size / 2
    edge = math.cos(half)
    wanted = (1 - edge) * (1 - light.spot_blend / 2)
    low, high = 0.0, 1.0
    for _ in range(20):
        softness = (low + high) / 2
        low, high = (softness, high) if _light_in_cone(half, softness) > wanted else (low, softness)
    return softness


def _light_in_cone(half, softness, steps=64):
    """The integral of USD's falloff over directions, divided by 2 pi: a smoothstep from `half` down."""
    inner = half * (1 - softness)
    width = (half - inner) / steps
    angles = [inner + width * (k + 0.5) for k in range(steps)]
    fades = [(share * share * (3 - 2 * share), angle) for angle in angles if (share := (half - angle) / (half - inner))]
    return 1 - math.cos(inner) + sum(fade * math.sin(angle) * width for fade, angle in fades)


def _correct_sky(prim, world):
    """A picture without a Mapping node is exported in USD's frame, where y is up, and never with its strength."""
    from pxr import Gf, UsdLux

    if not prim.GetAttribute("inputs:texture:file").HasAuthoredValue() or not world or not world.node_tree:
        return
    background = next((node for node in world.node_tree.nodes if node.type == "BACKGROUND"), None)
    strength = UsdLux.LightAPI(prim).GetIntensityAttr()
    if background and not strength.HasAuthoredValue():
        strength.Set(background.inputs["Strength"].default_value)
    turn = prim.GetAttribute("xformOp:rotateXYZ")
    if turn and max(map(abs, turn.Get())) == 0:
        turn.Set(Gf.Vec3f(*SKY_TURN))


def _is_seen_as_sky(prim):
    return prim.GetAttribute("inputs:intensity").Get() != 0


def _blacken(stage):
    """Without a sky the background is clear, where Blender has it black and opaque. A light of no intensity is none."""
    from pxr import UsdLux

    UsdLux.DomeLight.Define(stage, "/oocpt_black").CreateIntensityAttr(NO_LIGHT)


# ---- light linking ----


def _link_lights(lights, prims, data):
    from pxr import UsdLux

    paths = None
    for prim in lights:
        owner = data.object_of(prim)
        linking = owner.light_linking if owner else None
        if linking is None or not (linking.receiver_collection or linking.blocker_collection):
            continue
        paths = paths or _paths_of_objects(prims)
        api = UsdLux.LightAPI(prim)
        _author_links(api.GetLightLinkCollectionAPI(), linking.receiver_collection, paths)
        _author_links(api.GetShadowLinkCollectionAPI(), linking.blocker_collection, paths)


def _paths_of_objects(prims):
    paths = {}
    for prim in prims:
        if name := text_of(prim, OBJECT_NAME):
            paths.setdefault(name, []).append(prim.GetPath())
    return paths


def _author_links(api, collection, paths):
    """As Blender has it: a collection that includes something reaches that alone, one that only excludes the rest."""
    if collection is None:
        return
    states = {name: state for state, name in _linked(collection)}
    included = [path for name, state in states.items() if state == "INCLUDE" for path in paths.get(name, ())]
    excluded = [path for name, state in states.items() if state == "EXCLUDE" for path in paths.get(name, ())]
    is_rest = "INCLUDE" not in states.values()
    if pins.OPENUSD < (0, 26, 3):
        # Its scene delegate takes all expressions for the same collection.
        api.CreateIncludeRootAttr(is_rest)
        api.CreateIncludesRel().SetTargets(included)
        api.CreateExcludesRel().SetTargets(excluded)
    else:
        _author_expression(api, is_rest, included, excluded)


def _author_expression(api, is_rest, included, excluded):
    """One that matches below any root: Blender 5.2 puts the stage below a root of its own in Hydra's scene, which paths
    of relationships do not follow."""
    from pxr import Sdf

    reached, spared = (" + ".join(f"/{path}//" for path in paths) for paths in (included, excluded))
    if is_rest:
        text = f"~({spared})" if spared else "//"
    else:
        text = f"({reached}) - ({spared})" if reached and spared else reached
    api.CreateIncludeRootAttr(False)
    api.CreateMembershipExpressionAttr(Sdf.PathExpression(text))


def _linked(collection):
    """Pairs of state and object's name, those that count last."""
    for child, entry in zip(collection.children, collection.collection_children, strict=True):
        for one in child.all_objects:
            yield entry.light_linking.link_state, one.name
    for one, entry in zip(collection.objects, collection.collection_objects, strict=True):
        yield entry.light_linking.link_state, one.name


# ---- hair of particles ----


def _dress_particles(prims, data):
    """The exporter writes hair of particles without widths and without material."""
    from pxr import UsdGeom, UsdShade

    materials_at = {text_of(prim, DATA_NAME): prim for prim in prims.of("Material")}
    for prim in prims.of("BasisCurves"):
        if prim.GetAttribute("widths").HasAuthoredValue():
            continue
        owner = data.object_of(prim)
        systems = [one for one in getattr(owner, "particle_systems", ()) if one.settings.type == "HAIR"]
        system = next((one for one in systems if _is_named(prim, one.name)), systems[0] if systems else None)
        if system is None:
            continue
        curves = UsdGeom.BasisCurves(prim)
        curves.CreateWidthsAttr(_widths(curves.GetCurveVertexCountsAttr().Get() or (), system.settings))
        curves.SetWidthsInterpolation(UsdGeom.Tokens.vertex)
        slot = system.settings.material - 1
        chosen = owner.material_slots[slot].material if 0 <= slot < len(owner.material_slots) else None
        if chosen:
            at = materials_at.get(chosen.name) or materials.define_plain(prim, chosen)
            UsdShade.MaterialBindingAPI.Apply(prim).Bind(UsdShade.Material(at))


def _is_named(prim, name):
    return "".join(c if c.isalnum() else "_" for c in name) == prim.GetName()


def _widths(counts, settings):
    """Diameters from root to tip, by Blender's shape of a strand."""
    # What Blender names radii are diameters.
    root, tip = (width * settings.radius_scale for width in (settings.root_radius, settings.tip_radius))
    power = 1 + settings.shape if settings.shape < 0 else 1 / max(1 - settings.shape, 1e-3)
    strands = {}
    for count in set(counts):
        along = [(k / max(count - 1, 1)) ** power for k in range(count)]
        strands[count] = [root + (tip - root) * share for share in along]
        if settings.use_close_tip and count:
            strands[count][-1] = 0.0
    return [width for count in counts for width in strands[count]]


# ---- what has no material ----


def _color_bare(prims):
    from pxr import UsdGeom, UsdShade

    for prim in prims.of("Mesh", "BasisCurves", "Points"):
        color = UsdGeom.Gprim(prim).GetDisplayColorAttr()
        if color.HasAuthoredValue() or UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]:
            continue
        if not any(child.GetTypeName() == "GeomSubset" for child in prim.GetChildren()):
            UsdGeom.Gprim(prim).CreateDisplayColorAttr([BARE_COLOR])


# ---- shadow catchers, holdouts ----


def _mark_unseen(prims, data):
    from pxr import Sdf, UsdGeom

    if not any(getattr(one, flag) for one in data.objects.values() for flag, _ in UNSEEN):
        return
    for prim in prims.of("Mesh", "BasisCurves", "Points"):
        owner = data.object_of(prim)
        for flag, name in UNSEEN:
            if owner is not None and getattr(owner, flag):
                UsdGeom.PrimvarsAPI(prim).CreatePrimvar(name, Sdf.ValueTypeNames.Bool).Set(True)


def register():
    bpy.utils.register_class(OocPTStageHook)


def unregister():
    bpy.utils.unregister_class(OocPTStageHook)
