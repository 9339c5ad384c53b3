# SPDX-License-Identifier: Apache-2.0
"""Feature scenes of materials against known answers, both front ends. The scenes are described in
tests/scenes/feature_surfaces.py."""

import compare
import feature_surfaces as scenes
import featured
import numpy as np

def test_emission(host):
    """What glows shows its emissiveColor, whatever its size; black stays black."""
    for cell, color in zip(
        featured.row_of(host, "material_emission", 4), ((1, 0, 0), (0.25, 0.5, 0.75), (4, 2, 1), (0, 0, 0))
    ):
        compare.near(cell, color, 1e-5, f"emission {color}")


def test_mirror(host):
    """metallic 1: F0 and F90 are the albedo, so a smooth mirror in a white world shows it."""
    for cell, color in zip(featured.row_of(host, "material_mirror", 4), scenes.MIRRORS):
        compare.near(cell, color, 1e-3, f"mirror {color}")


def test_mirror_at_the_last_bounce(host):
    """The ray that leaves the last surface still finds the lights: a mirror shows a lamp with no bounces at all. Shadow
    rays cannot."""
    lamp = """
for prim in list(stage.Traverse()):
    if prim.IsA(UsdLux.DomeLight):
        prim.SetActive(False)
lamp = UsdLux.RectLight.Define(stage, "/World/Behind")
lamp.CreateWidthAttr(100.0); lamp.CreateHeightAttr(100.0); lamp.CreateIntensityAttr(1.0)
UsdGeom.XformCommonAPI(lamp).SetTranslate(Gf.Vec3d(0, 0, 50))
"""
    for cell, color in zip(featured.row_of(host, "material_mirror", 4, bounces=0, edit=lamp), scenes.MIRRORS):
        compare.near(cell, color, 1e-3, f"mirror {color}")


def test_white_metal_furnace(host):
    """Rough or smooth, a white metal in a white world returns all light (multiple scattering between microfacets
    included)."""
    for cell, roughness in zip(
        featured.row_of(host, "material_furnace_metal", 5, samples=1024), scenes.METAL_ROUGHNESS
    ):
        compare.near(cell.mean(), 1.0, 5e-3, f"roughness {roughness}")


def test_white_plastic_furnace(host):
    """A white dielectric may lose some light to its model, but nothing is gained."""
    for cell, roughness in zip(
        featured.row_of(host, "material_furnace_plastic", 5, samples=1024), scenes.METAL_ROUGHNESS
    ):
        assert 0.93 < cell.mean() < 1.003, f"roughness {roughness}: {cell.mean()}"


def test_fresnel_straight_on(host):
    """F0 = ((1 - ior) / (1 + ior))^2, or specularColor in the specular workflow."""
    made = featured.row_of(host, "material_fresnel", 4, samples=256, rows=2)
    for cell, ior in zip(made[:4], scenes.IORS):
        compare.near(cell.mean(axis=(0, 1)), ((1 - ior) / (1 + ior)) ** 2, 1e-3, f"ior {ior}")
    for cell, color in zip(made[4:], scenes.SPECULARS):
        compare.near(cell.mean(axis=(0, 1)), color, 2e-3, f"specularColor {color}")


def test_coat_straight_on(host):
    """A coat of ior 1.5 over black reflects 4 % of a white world, half a coat half as much."""
    for cell, amount in zip(featured.row_of(host, "material_coat", 3, samples=256), (0.0, 0.5, 1.0)):
        compare.near(cell.mean(), 0.04 * amount, 2e-3, f"coat {amount}")


def test_glass_furnace(host):
    """A block of clear glass in a white world is not to be seen: what enters a block leaves it again."""
    made = featured.picture(host, "material_glass", (32, 32), samples=64, bounces=32)
    compare.near(made.mean(axis=(0, 1)), 1.0, 3e-3, "mean")
    compare.near(featured.blocks(made, np.ones((32, 32), bool), 4, 4), 1.0, 1e-2, "blocks")


def test_cutout(host):
    """opacityThreshold: each side of 1/2 is all there or not there at all."""
    made = featured.picture(host, "material_cutout", (32, 32), samples=64)
    for index, color in enumerate(((0.0, 0.25, 2.0), (0.0, 0.25, 2.0), (1.0, 0.5, 0.25), (1.0, 0.5, 0.25))):
        compare.near(made[4:28, 8 * index + 2 : 8 * index + 6], color, 1e-5, f"column {index}")


def test_cutout_shadow(host):
    """Shadow rays ask the same picture: sun of irradiance pi, albedo 1/2."""
    made = featured.picture(host, "material_cutout_shadow", (32, 32), samples=64)
    for index, lit in enumerate((1, 1, 0, 0)):
        compare.near(made[4:28, 8 * index + 2 : 8 * index + 6], 0.5 * lit, 1e-5, f"column {index}")


def test_normal_map(host):
    """A mirror with its normal bent to n, seen along -z, shows direction 2 n.z n - z of a world of radiance 1 + d."""
    for cell, normal in zip(featured.row_of(host, "material_normal_map", 4, samples=256), scenes.NORMALS):
        n = np.array(normal) / np.linalg.norm(normal)
        d = 2 * n[2] * n - np.array([0, 0, 1])
        compare.near(cell.mean(axis=(0, 1)), 1 + d, 1e-2, f"normal {normal}")


def test_subsets(host):
    """Faces of a GeomSubset have its material; the others the mesh's."""
    for cell, color in zip(
        featured.row_of(host, "material_subsets", 4),
        ((1.0, 0.0, 0.5), (1.0, 0.0, 0.5), (0.0, 1.0, 0.25), (0.1, 0.2, 0.3)),
    ):
        compare.near(cell, color, 1e-5, f"face {color}")


def test_bindings(host):
    """Inherited, own, and by a collection of an ancestor."""
    for cell, color in zip(
        featured.row_of(host, "material_collection", 3), ((0.5, 0.25, 0.0), (0.0, 0.5, 0.25), (0.25, 0.0, 0.5))
    ):
        compare.near(cell, color, 1e-5, f"binding {color}")


def test_primvar_readers(host):
    """Every interpolation, at points where its value is plain: the middle of the left face."""
    made = featured.picture(host, "material_primvars", (6 * featured.CELL, 6 * featured.CELL), samples=64)
    value = lambda k: np.array([0.125 * (k + 1), 1 - 0.0625 * k, 0.5 * (k % 2)])
    corners = {
        "constant": [0], "uniform": [0], "varying": [0, 1, 4, 3], "vertex": [0, 1, 4, 3], "faceVarying": [0, 1, 2, 3]
    }
    middle = 3 * featured.CELL
    for index, (interpolation, numbers) in enumerate(corners.items()):
        # The left face is from -0.45 to 0 of the cell; the mean over it is that of its corners where the quad is flat
        # in the values.
        face = made[middle - 3 : middle + 3, index * featured.CELL + 2 : index * featured.CELL + 7]
        expected = np.mean([value(k) for k in numbers], axis=0)
        if len(numbers) == 1:
            compare.near(face, expected, 1e-5, interpolation)
        else:
            # Two of the channels are planar over the quad; the third depends on how it is cut into triangles.
            compare.near(face.mean(axis=(0, 1))[:2], expected[:2], 0.04, interpolation)
            assert 0 <= face[..., 2].min() and face[..., 2].max() <= 0.5, interpolation
    compare.near(
        made[middle - 3 : middle + 3, 5 * featured.CELL + 3 : 5 * featured.CELL + 13], (0.3, 0.6, 0.9), 1e-5, "fallback"
    )


def test_instance_primvars(host):
    """A primvar of the instancer reaches the reader, one value per instance."""
    for index, cell in enumerate(featured.row_of(host, "material_instance_primvars", 4)):
        compare.near(cell, (0.25 * index, 1 - 0.25 * index, 0.5), 1e-5, f"instance {index}")


def test_display_color_without_material(host):
    """Lambert of displayColor, of the instance's where the instancer has it, and of 0.18 where nobody has one."""
    made = featured.row_of(host, "material_display_color", 4)
    for index in range(3):
        compare.near(made[index], (0.25 * (index + 1), 0.5, 0.1 * index), 1e-5, f"instance {index}")
    compare.near(made[3], 0.18, 1e-5, "no colour")


def test_display_color_by_level(host):
    """The mesh's own wins, then the innermost instancer's; native instances and constants are inherited as USD says."""
    made = featured.row_of(host, "material_instance_levels", 8)
    outer = [color for color in scenes.OUTER_COLORS for _ in range(2)]
    expected = [*outer, *scenes.NATIVE_COLORS, scenes.CONSTANT_COLOR, scenes.OWN_COLOR]
    for index, (cell, color) in enumerate(zip(made, expected)):
        compare.near(cell, color, 1e-5, f"cell {index}")


def test_edits_of_instance_colors(host):
    """Other colours, then opacities of the instances, in a picture that is there already."""
    size = (4 * featured.CELL, 4 * featured.CELL)
    row = "UsdGeom.PrimvarsAPI(stage.GetPrimAtPath('/World/Row'))"
    colors = ((0.9, 0.1, 0.2), (0.2, 0.9, 0.1), (0.1, 0.2, 0.9))
    with host.open(featured.path("material_display_color"), size, settings=featured.settings(64, 1)) as view:
        view.render()
        view.edit(f"{row}.GetPrimvar('displayColor').Set({colors!r})")
        made = featured.cells(view.render()["color"][..., :3].astype(np.float64), 4)
        for index, color in enumerate(colors):
            compare.near(made[index], color, 1e-5, f"instance {index}")
        view.edit(
            f"{row}.CreatePrimvar('displayOpacity', Sdf.ValueTypeNames.FloatArray, 'vertex').Set([0.0, 1.0, 0.5])"
        )
        alpha = featured.cells(view.render()["color"][..., 3:].astype(np.float64), 4)
        assert alpha[0].max() == 0.0 and alpha[1].min() == 1.0 and alpha[3].min() == 1.0, "not there, and there"
        # 64 pixels of 64 samples.
        assert abs(alpha[2].mean() - 0.5) <= 4.5 * 0.5 / 64, f"{alpha[2].mean()} of the rays met it"
