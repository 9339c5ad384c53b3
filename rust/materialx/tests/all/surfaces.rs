// SPDX-License-Identifier: Apache-2.0
//! Surface models as inputs of the BSDF, textures with their places, programs.

use oocpt_materialx::InputSource;
use oocpt_materialx::network::NetworkNode;
use oocpt_materialx::program::Geometry;
use oocpt_materialx::surface::Input;

use crate::support::{file, node, number, sound, source, text, translated, value, vector};

const STANDARD: &str = "ND_standard_surface_surfaceshader";
const OPEN_PBR: &str = "ND_open_pbr_surface_surfaceshader";

fn constant(source: InputSource) -> [f32; 4] {
    match source {
        InputSource::Constant(value) => value,
        other => panic!("no constant: {other:?}"),
    }
}

#[test]
fn a_standard_surface_is_its_constants() {
    let translation = sound(vec![node(
        STANDARD,
        &[
            ("base", number(0.5)),
            ("base_color", vector(0.8, 0.4, 0.2)),
            ("metalness", number(1.0)),
            ("coat", number(0.3)),
        ],
        &[],
    )]);
    let of = |input| constant(source(&translation, input));
    assert_eq!(of(Input::DiffuseColor)[..3], [0.4, 0.2, 0.1]);
    assert_eq!((of(Input::Metallic)[0], of(Input::Roughness)[0], of(Input::Clearcoat)[0]), (1.0, 0.2, 0.3));
    assert!(!translation.specular_workflow && translation.program.instructions.is_empty(), "{translation:?}");
}

/// F0 = weight ((n - 1) / (n + 1))^2, as an index without transmission and as a colour with a tint.
#[test]
fn the_specular_weight_scales_reflectance() {
    let weighed = sound(vec![node(OPEN_PBR, &[("specular_weight", number(0.5))], &[])]);
    let ior = constant(source(&weighed, Input::Ior))[0];
    let reflectance = ((ior - 1.0) / (ior + 1.0)).powi(2);
    assert!((reflectance - 0.02).abs() < 1e-6 && !weighed.specular_workflow, "{ior}");
    let tinted = sound(vec![node(OPEN_PBR, &[("specular_color", vector(1.0, 0.5, 0.25))], &[])]);
    let color = constant(source(&tinted, Input::SpecularColor));
    assert!((color[1] - 0.02).abs() < 1e-6 && tinted.specular_workflow, "{color:?}");
}

#[test]
fn directly_connected_images_stay_textures() {
    let translation = sound(vec![
        node(STANDARD, &[("base", number(1.0))], &[("base_color", 1), ("specular_roughness", 2), ("normal", 4)]),
        node("ND_image_color3", &[("file", file("color.png"))], &[]),
        node("ND_image_float", &[("file", file("rough.png"))], &[("texcoord", 3)]),
        node("ND_place2d_vector2", &[("scale", vector(0.5, 0.25, 0.0))], &[("texcoord", 6)]),
        node("ND_normalmap_float", &[("scale", number(2.0))], &[("in", 5)]),
        node("ND_image_vector3", &[("file", file("normal.png")), ("uaddressmode", text("clamp"))], &[]),
        node("ND_texcoord_vector2", &[], &[]),
    ]);
    assert!(translation.program.instructions.is_empty(), "no program: {translation:?}");
    let InputSource::Texture(color, None) = source(&translation, Input::DiffuseColor) else {
        panic!("{translation:?}")
    };
    assert_eq!((color.uv, color.transform), (Some(0), [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]));
    let InputSource::Texture(rough, Some(0)) = source(&translation, Input::Roughness) else {
        panic!("{translation:?}")
    };
    assert_eq!(rough.transform, [[2.0, 0.0, 0.0], [0.0, 4.0, 0.0]], "divided by the scale");
    let InputSource::Texture(normal, None) = source(&translation, Input::Normal) else { panic!("{translation:?}") };
    assert_eq!((&normal.scale[..3], &normal.bias[..3]), (&[4.0, 4.0, 2.0][..], &[-2.0, -2.0, -1.0][..]));
    let names: Vec<&str> = translation.uses.textures.iter().map(|texture| &*texture.file.resolved).collect();
    assert_eq!(names, ["color.png", "rough.png", "normal.png"]);
    assert_eq!(&*translation.uses.uv_sets[0], "st");
}

/// Noise chooses between two colours: a program, whose result is that of the noise itself.
#[test]
fn patterns_become_a_program() {
    let translation = sound(vec![
        node(OPEN_PBR, &[("base_weight", number(1.0))], &[("base_color", 1), ("specular_roughness", 2)]),
        node("ND_mix_color3", &[("fg", vector(1.0, 0.5, 0.0)), ("bg", vector(0.0, 0.5, 1.0))], &[("mix", 2)]),
        node("ND_noise3d_float", &[("amplitude", number(0.5)), ("pivot", number(0.5))], &[]),
    ]);
    let at = |what: Geometry| if what == Geometry::Primvar0 { [1.3, 2.7, -0.4, 0.0] } else { [0.0; 4] };
    let color = value(&translation, Input::DiffuseColor, at, |_, _| [0.0; 4]);
    let share = value(&translation, Input::Roughness, at, |_, _| [0.0; 4])[0];
    assert!(share > 0.05 && share < 0.95 && share != 0.5, "{share}");
    assert!((color[0] - share).abs() < 1e-6 && (color[2] - (1.0 - share)).abs() < 1e-6, "{color:?} {share}");
    assert_eq!(&*translation.uses.primvars[0].name, oocpt_materialx::uses::MaterialUses::POSITION);
}

/// A product of two textures is a program with two lookups that know their places.
#[test]
fn a_product_of_textures_becomes_a_program() {
    let translation = sound(vec![
        node(OPEN_PBR, &[("base_weight", number(1.0))], &[("base_color", 1)]),
        node("ND_multiply_color3", &[], &[("in1", 2), ("in2", 3)]),
        node("ND_image_color3", &[("file", file("a.png"))], &[]),
        node("ND_image_color3", &[("file", file("b.png"))], &[]),
    ]);
    assert_eq!(translation.program.lookups.len(), 2);
    let texel = |lookup: &oocpt_materialx::program::ProgramLookup, _| {
        [[0.5, 0.25, 0.125, 1.0], [0.5, 0.5, 1.0, 1.0]][lookup.texture as usize]
    };
    let color = value(&translation, Input::DiffuseColor, |_| [0.0; 4], texel);
    assert_eq!(color[..3], [0.25, 0.125, 0.125]);
}

/// A place that a texture distorts is an operand of the lookup.
#[test]
fn distorted_texture_coordinates_become_a_program() {
    let translation = sound(vec![
        node(OPEN_PBR, &[("base_weight", number(1.0))], &[("base_color", 1)]),
        node("ND_image_color3", &[("file", file("a.png"))], &[("texcoord", 2)]),
        node("ND_image_vector2", &[("file", file("b.png"))], &[]),
    ]);
    let texel = |lookup: &oocpt_materialx::program::ProgramLookup, place: [f32; 2]| {
        if translation.uses.textures[lookup.texture as usize].file.resolved.starts_with('b') {
            [0.75, 0.125, 0.0, 1.0]
        } else {
            [place[0], place[1], 0.0, 1.0]
        }
    };
    let color = value(&translation, Input::DiffuseColor, |_| [0.0; 4], texel);
    assert_eq!(color[..2], [0.75, 0.125]);
}

#[test]
fn glass_fuzz_and_coat_have_inputs_of_their_own() {
    let translation = sound(vec![node(
        OPEN_PBR,
        &[
            ("transmission_weight", number(1.0)),
            ("transmission_color", vector(0.9, 1.0, 0.8)),
            ("fuzz_weight", number(0.5)),
            ("fuzz_color", vector(1.0, 0.5, 0.0)),
            ("coat_weight", number(1.0)),
            ("coat_ior", number(1.7)),
            ("geometry_opacity", number(0.5)),
        ],
        &[],
    )]);
    let of = |input| constant(source(&translation, input));
    assert_eq!(of(Input::TransmissionColor)[..3], [0.9, 1.0, 0.8]);
    assert_eq!(of(Input::SheenColor)[..3], [0.5, 0.25, 0.0]);
    assert_eq!((of(Input::Transmission)[0], of(Input::CoatIor)[0], of(Input::Opacity)[0]), (1.0, 1.7, 0.5));
}

#[test]
fn every_model_is_a_surface() {
    for (kind, values) in [
        (
            "ND_gltf_pbr_surfaceshader",
            vec![("alpha_mode", number(1.0)), ("alpha", number(0.25)), ("metallic", number(0.5))],
        ),
        ("ND_disney_principled", vec![("metallic", number(0.5))]),
        ("ND_UsdPreviewSurface_surfaceshader", vec![("metallic", number(0.5)), ("opacityThreshold", number(0.5))]),
    ] {
        let translation = sound(vec![node(kind, &values, &[])]);
        assert_eq!(constant(source(&translation, Input::Metallic))[0], 0.5, "{kind}");
    }
    let unlit = sound(vec![node(
        "ND_surface_unlit",
        &[("emission", number(2.0)), ("emission_color", vector(1.0, 0.5, 0.0))],
        &[],
    )]);
    assert_eq!(constant(source(&unlit, Input::EmissiveColor))[..3], [2.0, 1.0, 0.0]);
}

/// What `surface_unlit` transmits goes on as it came, so its share is one of what is not opaque.
#[test]
fn unlit_transmission_makes_the_surface_less_opaque() {
    let of = |values: &[(&'static str, _)]| {
        let translation = translated(vec![node("ND_surface_unlit", values, &[])]);
        (constant(source(&translation, Input::Opacity))[0], translation.problems.len())
    };
    assert_eq!(of(&[("opacity", number(0.5)), ("transmission", number(0.25))]), (0.375, 0));
    assert_eq!(of(&[("transmission", number(2.0))]), (0.0, 0), "limited");
    assert_eq!(of(&[("transmission", number(0.5)), ("transmission_color", vector(1.0, 0.5, 0.0))]), (0.5, 1));
}

/// The sheen of Disney is white, mixed with the colour of the base by its tint, half of each where none is said.
#[test]
fn the_sheen_tint_of_disney_mixes_in_the_base_color() {
    let sheen = |values: &[(&'static str, _)]| {
        let color = ("baseColor", vector(0.25, 0.5, 1.0));
        let values: Vec<_> = values.iter().cloned().chain([color, ("sheen", number(0.5))]).collect();
        constant(source(&sound(vec![node("ND_disney_principled", &values, &[])]), Input::SheenColor))
    };
    assert_eq!(sheen(&[("sheenTint", number(0.0))])[..3], [0.5; 3]);
    assert_eq!(sheen(&[("sheenTint", number(1.0))])[..3], [0.125, 0.25, 0.5]);
    assert_eq!(sheen(&[])[..3], [0.3125, 0.375, 0.5]);
}

/// A closure whose two alphas come from a picture is anisotropic; one with a picture for both alike is not.
#[test]
fn pictures_of_two_alphas_make_an_anisotropic_lobe() {
    let anisotropy = |anisotropy: usize| {
        let translation = sound(vec![
            node("ND_surface", &[], &[("bsdf", 1)]),
            node("ND_conductor_bsdf", &[], &[("roughness", 2)]),
            node("ND_roughness_anisotropy", &[], &[("roughness", 3), ("anisotropy", anisotropy)]),
            node("ND_image_float", &[("file", file("rough.png"))], &[]),
            node("ND_constant_float", &[("value", number(0.0))], &[]),
        ]);
        source(&translation, Input::Anisotropy)
    };
    assert!(matches!(anisotropy(3), InputSource::Register(_)), "{:?}", anisotropy(3));
    assert_eq!(constant(anisotropy(4)), [1.0, 0.0, 1.0, 0.0]);
}

/// Disney's `ior` is of transmission; without any, reflection at normal incidence is 0.08 `specular`.
#[test]
fn the_index_of_disney_is_of_transmission_alone() {
    let reflectance = |values: &[(&'static str, _)]| {
        let translation = sound(vec![node("ND_disney_principled", values, &[])]);
        let ior = constant(source(&translation, Input::Ior))[0];
        ((ior - 1.0) / (ior + 1.0)).powi(2)
    };
    let opaque = reflectance(&[("ior", number(3.0)), ("specular", number(0.25))]);
    assert!((opaque - 0.02).abs() < 1e-6, "{opaque}");
    let glass = reflectance(&[("ior", number(3.0)), ("specTrans", number(1.0))]);
    assert!((glass - 0.25).abs() < 1e-6, "{glass}");
}

/// surface(layer(dielectric over diffuse)) is plastic; mixed with a conductor, half of it is metal.
#[test]
fn layered_closures_reduce_to_one_slab() {
    let plastic = || {
        vec![
            node("ND_surface", &[], &[("bsdf", 1)]),
            node("ND_layer_bsdf", &[], &[("top", 2), ("base", 3)]),
            node("ND_dielectric_bsdf", &[("ior", number(1.4)), ("roughness", vector(0.04, 0.04, 0.0))], &[]),
            node("ND_oren_nayar_diffuse_bsdf", &[("color", vector(0.8, 0.2, 0.1))], &[]),
        ]
    };
    let translation = sound(plastic());
    let of = |translation: &_, input| constant(source(translation, input));
    assert_eq!(of(&translation, Input::DiffuseColor)[..3], [0.8, 0.2, 0.1]);
    assert!(
        (of(&translation, Input::Roughness)[0] - 0.2).abs() < 1e-6
            && (of(&translation, Input::Ior)[0] - 1.4).abs() < 1e-6
    );
    let mut nodes = plastic();
    nodes[0] = node("ND_surface", &[], &[("bsdf", 4)]);
    nodes.push(node("ND_mix_bsdf", &[("mix", number(0.5))], &[("bg", 1), ("fg", 5)]));
    // In the colour of the plastic: metal and diffuse reflection share it.
    let metal = [("color0", vector(0.8, 0.2, 0.1)), ("roughness", vector(0.04, 0.04, 0.0))];
    nodes.push(node("ND_generalized_schlick_bsdf", &metal, &[]));
    assert_eq!(of(&sound(nodes), Input::Metallic)[0], 0.5);
}

#[test]
fn unsupported_inputs_give_one_warning_with_the_prim() {
    let translation = translated(vec![node(
        STANDARD,
        &[("transmission_extra_roughness", number(0.5)), ("transmission_scatter", vector(0.5, 0.5, 0.5))],
        &[],
    )]);
    let missing = "scattering inside, another roughness of what is transmitted";
    assert_eq!(translation.problems, [format!("/m/{STANDARD}: not supported yet: {missing}")]);
    assert!(translation.inputs.is_some(), "the rest is there");
}

#[test]
fn a_node_without_a_kind_is_named_by_its_path() {
    let unknown = || NetworkNode { path: "/m/own".into(), ..node("", &[], &[]) };
    let said = ["the host has no definition of /m/own"];
    let pattern = translated(vec![node(STANDARD, &[], &[("base_color", 1)]), unknown()]);
    assert_eq!(pattern.problems, said);
    assert!(pattern.inputs.is_some(), "the rest is there");
    let closure = translated(vec![node("ND_surface", &[], &[("bsdf", 1), ("edf", 1)]), unknown()]);
    assert_eq!(closure.problems, said, "as a closure and as an emission, once");
    assert_eq!(translated(vec![unknown()]).problems[0], said[0], "as the surface");
}

/// 1 / the Abbe number, as each model has it.
#[test]
fn dispersion_is_the_inverse_abbe_number() {
    let dispersion = |kind: &str, values: &[(&str, f32)]| {
        let values: Vec<_> = values.iter().map(|(name, value)| (*name, number(*value))).collect();
        let translation = sound(vec![node(kind, &values, &[])]);
        (translation.dispersive, constant(source(&translation, Input::Absorption))[3])
    };
    let open = "ND_open_pbr_surface_surfaceshader";
    let (scale, abbe) = ("transmission_dispersion_scale", "transmission_dispersion_abbe_number");
    assert_eq!(dispersion(open, &[(scale, 0.5), (abbe, 40.0)]), (true, 0.0125));
    assert_eq!(dispersion(open, &[(scale, 0.5)]), (true, 0.025), "20 is the default");
    assert!(!dispersion(open, &[(abbe, 40.0)]).0 && !dispersion(open, &[(scale, 0.5), (abbe, 0.0)]).0);
    assert_eq!(dispersion(STANDARD, &[("transmission_dispersion", 50.0)]), (true, 0.02));
    assert!(!dispersion(STANDARD, &[]).0);
    assert_eq!(dispersion("ND_gltf_pbr_surfaceshader", &[("dispersion", 0.5)]), (true, 0.025));
}

/// The alphas that a model says are those of the roughness and the ratio that the BSDF takes:
/// r^2 (2 / (1 + q^2))^(1/2), and q times it.
#[test]
fn anisotropic_alphas_follow_each_model() {
    let alphas = |kind: &str, values: &[(&str, f32)]| {
        let values: Vec<_> = values.iter().map(|(name, value)| (*name, number(*value))).collect();
        let translation = sound(vec![node(kind, &values, &[])]);
        let roughness = constant(source(&translation, Input::Roughness))[0];
        let [ratio, turn, ..] = constant(source(&translation, Input::Anisotropy));
        let along = roughness * roughness * (2.0 / (1.0 + ratio * ratio)).sqrt();
        [along, ratio * along, turn]
    };
    let close = |found: [f32; 3], known: [f32; 3]| {
        assert!(found.iter().zip(known).all(|(a, b)| (a - b).abs() < 1e-5), "{found:?}, not {known:?}");
    };
    let aspect = 0.25_f32.sqrt();
    let standard =
        [("specular_roughness", 0.5), ("specular_anisotropy", 0.75), ("specular_rotation", 0.125), ("base", 1.0)];
    close(alphas(STANDARD, &standard), [0.25 / aspect, 0.25 * aspect, 0.125]);
    let open = [("specular_roughness", 0.5), ("specular_roughness_anisotropy", 0.75)];
    let along = 0.25 * (2.0_f32 / (1.0 + 0.0625)).sqrt();
    close(alphas(OPEN_PBR, &open), [along, 0.25 * along, 0.0]);
}

/// Light that goes the depth inside keeps the colour; without a depth the interface has it.
#[test]
fn transmission_depth_becomes_absorption() {
    let of = |depth: f32| {
        let values = [("transmission_color", vector(0.5, 0.25, 1.0)), ("transmission_depth", number(depth))];
        let translation = sound(vec![node(OPEN_PBR, &values, &[])]);
        [Input::TransmissionColor, Input::Absorption].map(|input| constant(source(&translation, input)))
    };
    let [tint, absorption] = of(2.0);
    assert_eq!(tint[..3], [1.0; 3]);
    let left: Vec<f32> = absorption[..3].iter().map(|a| (-a * 2.0).exp()).collect();
    assert!(left.iter().zip([0.5, 0.25, 1.0]).all(|(a, b)| (a - b).abs() < 1e-5), "{left:?}");
    let [tint, absorption] = of(0.0);
    assert_eq!((&tint[..3], &absorption[..3]), (&[0.5, 0.25, 1.0][..], &[0.0; 3][..]));
}

/// Thicknesses of films are in nanometres for the BSDF; `OpenPBR` has micrometres.
#[test]
fn thin_film_and_thin_walls_follow_the_model() {
    let open = sound(vec![node(
        OPEN_PBR,
        &[("thin_film_weight", number(0.5)), ("thin_film_ior", number(1.3)), ("geometry_thin_walled", number(1.0))],
        &[],
    )]);
    assert_eq!(constant(source(&open, Input::ThinFilm))[..3], [0.5, 500.0, 1.3]);
    assert!(open.thin_walled);
    let standard = sound(vec![node(STANDARD, &[("thin_film_thickness", number(300.0))], &[])]);
    assert_eq!(constant(source(&standard, Input::ThinFilm))[..3], [1.0, 300.0, 1.5]);
    let none = sound(vec![node(STANDARD, &[], &[])]);
    assert!(constant(source(&none, Input::ThinFilm))[0] == 0.0 && !none.thin_walled);
}

/// The opacity has a program of its own, of few lookups; with more the surface is there.
#[test]
fn opacity_has_its_own_program() {
    let images = |count: usize| {
        let mut nodes = vec![node(OPEN_PBR, &[], &[("geometry_opacity", 1), ("specular_roughness", 1)])];
        for k in 0..count {
            let (image, next) = (2 * k + 2, 2 * k + 3);
            let last = k + 1 == count;
            let inputs = [("in1", image), ("in2", next)];
            nodes.push(node("ND_multiply_float", &[], if last { &inputs[..1] } else { &inputs }));
            nodes.push(node("ND_image_float", &[("file", file(&format!("{k}.png")))], &[]));
        }
        nodes
    };
    let four = sound(images(4));
    assert_eq!((four.program.lookups.len(), four.opacity_program.lookups.len()), (4, 4));
    let InputSource::Register(_) = source(&four, Input::Opacity) else { panic!("{four:?}") };
    let five = translated(images(5));
    assert_eq!(constant(source(&five, Input::Opacity)), [1.0; 4]);
    assert!(five.opacity_program.instructions.is_empty());
    assert!(five.problems.iter().any(|problem| problem.contains("opacity")), "{:?}", five.problems);
}

/// Each model's own roughness of its diffuse lobe; none of what is scattered below the surface.
#[test]
fn diffuse_roughness_follows_each_model() {
    let rough = |nodes| constant(source(&sound(nodes), Input::DiffuseRoughness))[0];
    assert_eq!(rough(vec![node(OPEN_PBR, &[("base_diffuse_roughness", number(0.4))], &[])]), 0.4);
    assert_eq!(rough(vec![node(STANDARD, &[("diffuse_roughness", number(0.3))], &[])]), 0.3);
    let below = [("base_diffuse_roughness", number(0.4)), ("subsurface_weight", number(0.75))];
    assert_eq!(rough(vec![node(OPEN_PBR, &below, &[])]), 0.1);
    let closure = vec![
        node("ND_surface", &[], &[("bsdf", 1)]),
        node("ND_oren_nayar_diffuse_bsdf", &[("roughness", number(0.2))], &[]),
    ];
    assert_eq!(rough(closure), 0.2);
    assert_eq!(rough(vec![node(OPEN_PBR, &[], &[])]), 0.0);
    // One channel of a file is a texture of the input itself.
    let mapped = sound(vec![
        node(OPEN_PBR, &[], &[("base_diffuse_roughness", 1)]),
        node("ND_image_float", &[("file", file("rough.png"))], &[]),
    ]);
    assert!(matches!(source(&mapped, Input::DiffuseRoughness), InputSource::Texture(..)), "{mapped:?}");
}
