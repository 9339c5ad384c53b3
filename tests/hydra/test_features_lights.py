# SPDX-License-Identifier: Apache-2.0
"""Feature scenes of lights against known answers (answers.py), both front ends. The scenes are described in
tests/scenes/feature_lights.py."""

import math

import answers
import compare
import feature_lights
import featured
import numpy as np
import pytest
from pxr import Gf, UsdLux

SIZE = 32
RADIANCE = feature_lights.ALBEDO / math.pi
"""Radiance of the floor per irradiance."""


def _matrix(name: str, path="/World/Light") -> np.ndarray:
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(featured.path(name))
    return np.array(UsdGeom.XformCache().GetLocalToWorldTransform(stage.GetPrimAtPath(path)))


def _floor(per_radiance: np.ndarray, radiance) -> np.ndarray:
    """The picture of the floor: (size, size, 3) from irradiance per radiance at several points a pixel."""
    return RADIANCE * per_radiance.mean(axis=-1)[..., None] * np.asarray(radiance, dtype=np.float64)


def _rect(points) -> np.ndarray:
    corners = np.array([(0.3 + x, 1.5, -0.2 + z) for x, z in ((-0.6, -0.4), (0.6, -0.4), (0.6, 0.4), (-0.6, 0.4))])
    return answers.polygon(points, corners)


LIGHTS = {
    # scene: (irradiance per radiance, radiance, world area of the light)
    "light_rect": (_rect, (2.0, 1.0, 0.5), 1.2 * 0.8),
    "light_disk": (lambda points: answers.disk(points, (-0.2, 1.4, 0.1), 0.6), (2.0, 2.0, 2.0), math.pi * 0.36),
    "light_sphere": (lambda points: answers.ball(points, (0.25, 1.7, 0.3), 0.4), (2.0, 4.0, 3.0), 4 * math.pi * 0.16),
    "light_cylinder": (
        lambda points: answers.quadrature(points, *answers.tube_pieces(_matrix("light_cylinder"), 1.5, 0.2)),
        (3.0, 3.0, 3.0), 2 * math.pi * 0.2 * 1.5,
    ),
    "light_rect_tilted": (
        lambda points: answers.quadrature(points, *answers.rect_pieces(_matrix("light_rect_tilted"), 0.5, 1.0)),
        (3.0, 3.0, 3.0), 0.5 * 2.0 * 1.0 * 0.5,
    ),
}


@pytest.mark.parametrize("normalize", [False, True], ids=["plain", "normalize"])
@pytest.mark.parametrize("name", LIGHTS)
def test_irradiance(host, name, normalize):
    """Every pixel's block of the floor; with `normalize` the radiance is divided by the light's area in the world."""
    answer, radiance, area = LIGHTS[name]
    expected = _floor(answer(answers.floor_points(SIZE)), radiance) / (area if normalize else 1.0)
    edit = f"UsdLux.LightAPI(stage.GetPrimAtPath('/World/Light')).CreateNormalizeAttr({normalize})"
    # Quadrature of the tube and of the tilted rectangle is good to 2e-4 and near the horizon to a part of the rim.
    featured.agree(featured.pictures(host, name, edit=edit), expected, name, relative=1e-3)


def test_point_light(host):
    """treatAsPoint with normalize: as a small ball of the same power; inverse square and cosine."""
    area = 4 * math.pi * 0.05**2
    expected = _floor(answers.ball(answers.floor_points(SIZE), (0.25, 1.7, 0.3), 0.05), [4 * math.pi / area] * 3)
    featured.agree(featured.pictures(host, "light_sphere_point"), expected, "point", relative=2e-3)


def test_color_temperatures(host):
    """A dome that the camera sees has UsdLux's own colour at every temperature, also beyond both ends of its range."""
    kelvins = [0.0, 999.0, *np.linspace(1000.0, 2500.0, 25), *np.linspace(2600.0, 10000.0, 38), 10001.0, 40000.0]
    scene = '#usda 1.0\ndef Camera "Camera" {\n}\ndef DomeLight "Dome" {\n bool inputs:enableColorTemperature = 1\n}\n'
    with host.open(scene, (4, 4), camera="/Camera", settings=featured.settings(1, 0)) as view:
        for kelvin in kelvins:
            view.edit(f"UsdLux.LightAPI(stage.GetPrimAtPath('/Dome')).CreateColorTemperatureAttr({kelvin})")
            compare.near(
                view.render()["color"][..., :3], list(UsdLux.BlackbodyTemperatureAsRgb(kelvin)), 1e-3, f"{kelvin} K"
            )


@pytest.mark.parametrize("kelvin", [1500.0, 2700.0, 6500.0, 10000.0])
def test_color_temperature(host, kelvin):
    """Colour and exposure of the ball times UsdLux's own blackbody colour."""
    edit = (
        "light = UsdLux.LightAPI(stage.GetPrimAtPath('/World/Light')); light.CreateEnableColorTemperatureAttr(True);"
        f" light.CreateColorTemperatureAttr({kelvin}); light.CreateExposureAttr(1.5)"
    )
    answer, radiance, _ = LIGHTS["light_sphere"]
    expected = _floor(
        answer(answers.floor_points(SIZE)),
        np.array(radiance) * 2**1.5 * np.array(UsdLux.BlackbodyTemperatureAsRgb(kelvin)),
    )
    featured.agree(featured.pictures(host, "light_sphere", edit=edit), expected, f"{kelvin} K", relative=2e-3)


@pytest.mark.parametrize(
    ("angle", "softness", "focus"), [(25, 0.0, 0.0), (25, 0.6, 0.0), (40, 1.0, 0.0), (90, 0.0, 8.0), (30, 0.5, 3.0)]
)
def test_cone(host, angle, softness, focus):
    """1 - smoothstep over the soft part of the cone, times cos^focus; away from hard edges. Where the cone fades out,
    light falls with the square of the distance to its edge: four points a pixel are off by 3 % there, 64 by 0.2 %."""
    edit = (
        f"s = UsdLux.ShapingAPI(stage.GetPrimAtPath('/World/Light')); s.CreateShapingConeAngleAttr({angle});"
        f" s.CreateShapingConeSoftnessAttr({softness}); s.CreateShapingFocusAttr({focus})"
    )
    soft = softness > 0
    points = answers.floor_points(SIZE, over=8 if soft else 2)
    values = answers.quadrature(
        points, *answers.disk_pieces((0, 1.5, 0), 0.03, *(4, 12) if soft else (8, 24)),
        shape=answers.cone(angle, softness, focus),
    )
    mask = None if soft else answers.smooth_pixels(values)
    assert mask is None or mask.mean() > 0.6
    featured.agree(
        featured.pictures(host, "light_cone", edit=edit), _floor(values, [200.0] * 3),
        f"cone {angle} {softness} {focus}", mask, relative=3e-3,
    )


def test_ies_profile(host):
    """What leaves at an angle is as the profile says, linearly between its lines; only ratios to straight down are told
    by UsdLux."""
    points = answers.floor_points(SIZE)
    relative = (
        lambda cosine: np.interp(
            np.degrees(np.arccos(np.clip(cosine, -1, 1))), feature_lights.IES, feature_lights.IES_CANDELA
        )
        / feature_lights.IES_CANDELA[0]
    )
    to = np.array([0, 1.5, 0]) - points
    distance = np.linalg.norm(to, axis=-1)
    shape = (relative(to[..., 1] / distance) * to[..., 1] / distance**3).mean(axis=-1)
    made = np.mean(featured.pictures(host, "light_ies"), axis=0)
    assert made.max() > 0
    middle = slice(SIZE // 2 - 2, SIZE // 2 + 2)
    ratios, wanted = featured.blocks(
        made / made[middle, middle].mean(), np.ones(shape.shape, bool), 8, 8
    ), featured.blocks((shape / shape[middle, middle].mean())[..., None], np.ones(shape.shape, bool), 8, 8)
    compare.near(ratios, wanted, 0.02, "profile")


AXES = {"x": 0, "y": 1, "z": 2}


def _box_faces(host, name, edit=None):
    """Mean colour of the box's faces towards +x, +y, +z, away from their edges."""
    with host.open(
        featured.path(name), (48, 48), aovs=["color", "normal"], settings=featured.settings(1024, 0)
    ) as view:
        if edit:
            view.edit(edit)
        picture = view.render()
    made = {}
    for axis, index in AXES.items():
        on = picture["normal"][..., index] > 0.99
        on = on & np.roll(on, 1, 0) & np.roll(on, -1, 0) & np.roll(on, 1, 1) & np.roll(on, -1, 1)
        assert on.sum() > 50
        made[axis] = picture["color"][on][:, :3].astype(np.float64).mean(axis=0)
    return made


TURNS = {
    # edit -> matrix from the picture's directions to the world
    "as it is": (None, np.eye(3)),
    "about y": (
        "UsdGeom.Xformable(stage.GetPrimAtPath('/World/Dome')).AddRotateYOp().Set(90.0)",
        np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]]),
    ),
    "about x": (
        "UsdGeom.Xformable(stage.GetPrimAtPath('/World/Dome')).AddRotateXOp().Set(90.0)",
        np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]),
    ),
}


@pytest.mark.parametrize("turn", TURNS)
def test_dome_texture(host, turn):
    """Radiance 1 + d.k in channel k, d in the dome's frame: a face n gets pi + 2/3 pi n.k. OpenEXR's rule for latlongs,
    and the dome's transform."""
    edit, matrix = TURNS[turn]
    for axis, color in _box_faces(host, "light_dome_texture", edit).items():
        normal = matrix.T @ np.eye(3)[AXES[axis]]
        compare.near(color, feature_lights.ALBEDO * (1 + 2 / 3 * normal), 3e-3, f"face {axis}, {turn}")


def test_dome_pole_axis(host):
    """DomeLight_1 with pole z: the picture's +y is the world's +z, its +z the world's -y."""
    matrix = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    for axis, color in _box_faces(host, "light_dome_axis").items():
        normal = matrix.T @ np.eye(3)[AXES[axis]]
        compare.near(color, feature_lights.ALBEDO * (1 + 2 / 3 * normal), 3e-3, f"face {axis}")


def test_dome_sun_is_sampled(host):
    """A square of 2 x 2 bright texels: irradiance by the sum over texels; noise that only importance sampling
    reaches."""
    height, width = 64, 128
    latitude = math.pi / 2 - math.pi * (np.arange(height * 8) + 0.5) / (height * 8)
    longitude = math.pi - 2 * math.pi * (np.arange(width * 8) + 0.5) / (width * 8)
    # Bilinear between texel centres: a tent of one texel to each side of the square.
    tent = lambda count, first: np.clip(1.5 - np.abs((np.arange(count * 8) + 0.5) / 8 - (first + 1)), 0, 1)
    value = 0.02 + (1e4 - 0.02) * np.outer(tent(height, 15), tent(width, 40))
    up = np.sin(latitude)[:, None] * np.ones_like(longitude)
    solid = np.cos(latitude)[:, None] * (math.pi / (height * 8)) * (2 * math.pi / (width * 8))
    expected = RADIANCE * (value * np.maximum(up, 0) * solid).sum()
    made = featured.pictures(host, "light_dome_sun", samples=64)
    mean = np.mean(made, axis=0)
    compare.near(mean.mean(), expected, 5e-3 * expected, "irradiance")
    assert np.std(made[0]) < 0.1 * expected, "64 samples leave more than 10 % of noise"


@pytest.mark.parametrize("shadow", [True, False])
def test_shadow_enable(host, shadow):
    """Sun of irradiance pi on albedo 1/2: 1/2 in the light; below the roof 0, or 1/2 with shadows off."""
    made = featured.picture(
        host, "light_shadow",
        edit=f"UsdLux.ShadowAPI(stage.GetPrimAtPath('/World/Sun')).CreateShadowEnableAttr({shadow})",
    )
    compare.near(made[:, SIZE // 2 + 1 :], 0.5, 1e-5, "in the light")
    compare.near(made[:, : SIZE // 2 - 1], 0.0 if shadow else 0.5, 1e-5, "below the roof")


def test_light_and_shadow_links(host):
    """Each sun shines on one square; the roof shadows the green one only, as the others have their shadows from Square0
    alone. Suns that are not linked to a square are not asked there: no noise."""
    made = featured.picture(host, "light_links", size=(54, 54))
    for index, expected in enumerate(((0.5, 0, 0), (0, 0, 0), (0, 0, 0.5))):
        left = 3 + 18 * index
        compare.near(made[22:32, left + 2 : left + 10], expected, 1e-5, f"square {index}")


def test_light_multipliers(host):
    """Lambert's radiance times the diffuse multiplier; the specular one has nothing to act on."""
    compare.near(featured.picture(host, "light_multipliers"), 0.5 * 0.25, 1e-5, "floor")


def _hundred(points) -> np.ndarray:
    total = np.zeros((*points.shape[:2], 3))
    for number, position in enumerate(feature_lights.grid_places()):
        color = np.array([1.0 if number % 3 == channel else 0.2 for channel in range(3)])
        total += answers.ball(points, position, 0.05).mean(axis=-1)[..., None] * color * 10.0 * (1 + number % 4)
    return RADIANCE * total


@pytest.mark.parametrize("name", ["lights_hundred", "lights_instanced"])
def test_a_hundred_lights(host, name):
    """The sum of a hundred balls, as prims and as instances of twelve."""
    featured.agree(
        featured.pictures(host, name, samples=256), _hundred(answers.floor_points(SIZE)), name, relative=1e-3
    )


def test_mesh_light(host):
    """An emissive rectangle gives what a rectangle light of the same radiance gives."""
    expected = _floor(_rect(answers.floor_points(SIZE)), (2.0, 1.0, 0.5))
    featured.agree(featured.pictures(host, "light_mesh", samples=256), expected, "mesh light", relative=1e-3)


BIND = "UsdShade.MaterialBindingAPI.Apply(panel).Bind(UsdShade.Material(stage.GetPrimAtPath('/World/Looks/Glow')))"
MESH_LIGHTS = {
    # edit of the scene: radiance by colour
    "plain": ("", (2.0, 1.0, 0.5)),
    "normalize": ("light.CreateNormalizeAttr(True)", tuple(v / 0.96 for v in (2.0, 1.0, 0.5))),
    "temperature": (
        "light.CreateEnableColorTemperatureAttr(True); light.CreateColorTemperatureAttr(3000.0)",
        "blackbody",
    ),
    "glow tints": (BIND, (1.0, 1.0, 1.5)),
    "glow tints, named": (f"{BIND}; sync.Set('materialGlowTintsLight')", (1.0, 1.0, 1.5)),
    "independent": (f"{BIND}; sync.Set('independent')", (2.0, 1.0, 0.5)),
    "no response": (f"{BIND}; sync.Set('noMaterialResponse')", (2.0, 1.0, 0.5)),
    "no light": ("panel.RemoveAppliedSchema('MeshLightAPI')", (0.0, 0.0, 0.0)),
    "no light, glowing": (f"{BIND}; panel.RemoveAppliedSchema('MeshLightAPI')", (0.5, 1.0, 3.0)),
}


@pytest.mark.parametrize("case", MESH_LIGHTS)
def test_mesh_light_api(host, case):
    """A mesh that is a light by MeshLightAPI: the rectangle's irradiance, whatever its material does beside it."""
    edit, radiance = MESH_LIGHTS[case]
    if radiance == "blackbody":
        radiance = tuple(a * b for a, b in zip((2.0, 1.0, 0.5), UsdLux.BlackbodyTemperatureAsRgb(3000.0)))
    expected = _floor(_rect(answers.floor_points(SIZE)), radiance)
    begin = (
        "from pxr import UsdLux, UsdShade; panel = stage.GetPrimAtPath('/World/Panel'); light ="
        " UsdLux.LightAPI(panel); "
    )
    sync = "sync = light.CreateMaterialSyncModeAttr(); " if "sync." in edit else ""
    # The first picture is that of the scene as it is: what follows is an edit.
    made = featured.pictures(host, "light_mesh_api", samples=256, edit=begin + sync + edit)
    featured.agree(made, expected, f"mesh light, {case}", relative=2e-3)


def test_unsupported_mesh_light_api_inputs_give_a_warning(host):
    edit = (
        "from pxr import UsdLux; shaping = UsdLux.ShapingAPI.Apply(stage.GetPrimAtPath('/World/Panel'));"
        " shaping.CreateShapingConeAngleAttr(30.0)"
    )
    with host.open(
        featured.path("light_mesh_api"), (16, 16), settings=featured.settings(1, 0), camera="/World/Camera"
    ) as view:
        view.edit(edit)
        log = view.render().log
    lines = [line for line in log.splitlines() if "/World/Panel" in line]
    assert len(lines) == 1 and "shaping" in lines[0], log


def test_rect_light_texture(host):
    """Seen in a mirror below: which quarter is where. UsdLux: "a texture file's min coordinates should be at (+X, +Y)
    and max coordinates at (-X, -Y)", the first texel of a file being its upper left one: from its front (-z) the light
    shows the picture as it is. (OpenUSD's hdEmbree mirrors it.)"""
    made = featured.picture(host, "light_rect_texture", samples=64, bounces=1)
    # The light lies at -90 degrees about x: its +y is the world's -z, which is up in the picture; its +x is the world's
    # +x.
    quarters = {
        "upper right": (slice(20, 28), slice(20, 28), (1, 0, 0)),
        "upper left": (slice(20, 28), slice(4, 12), (0, 1, 0)), "lower right": (slice(4, 12), slice(20, 28), (0, 0, 1)),
        "lower left": (slice(4, 12), slice(4, 12), (1, 1, 1)),
    }
    for where, (rows, columns, color) in quarters.items():
        compare.near(made[rows, columns], color, 0.02, where)


def test_gf_matrices_are_rows():
    """The answers above read USD's matrices as rows."""
    assert np.array(Gf.Matrix4d().SetTranslate(Gf.Vec3d(1, 2, 3)))[3].tolist() == [1, 2, 3, 1]
