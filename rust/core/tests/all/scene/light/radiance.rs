// SPDX-License-Identifier: Apache-2.0
//! `UsdLux` maths against closed forms and published colours.

use oocpt_abi::Features;
use std::f64::consts::PI;

use glam::{DMat4, DQuat, DVec3};
use oocpt_core::scene::{LightEmitter, blackbody};
use oocpt_core::{Light, LightDesc, LightKind, SceneDb};

use crate::support::{committed, prim};

fn light(kind: LightKind) -> LightDesc {
    LightDesc {
        prim: prim("/light"),
        kind,
        color: [1.0, 0.5, 0.25],
        intensity: 3.0,
        exposure: 2.0,
        color_temperature: None,
        normalize: false,
        camera_visible: false,
        ..LightDesc::default()
    }
}

/// Direction, radiance and `1 - cos` of a distant light.
fn distant(desc: &LightDesc) -> ([f32; 3], [f32; 3], f32) {
    let light = Light::from_desc(desc).expect("a light");
    let distant = match light.emitter {
        LightEmitter::Distant { direction, one_minus_cos } => Some((direction, one_minus_cos)),
        _ => None,
    };
    let (direction, one_minus_cos) = distant.expect("a distant light");
    (direction, light.radiance, one_minus_cos)
}

#[test]
fn intensity_exposure_and_color_multiply() {
    let dome = Light::from_desc(&light(LightKind::PLAIN_DOME));
    let dome = dome.expect("a dome");
    assert_eq!(
        (dome.emitter, dome.radiance, dome.camera_visible),
        (LightEmitter::Dome { texture: None }, [12.0, 6.0, 3.0], false)
    );
}

#[test]
fn a_distant_light_shines_along_minus_z() {
    let mut desc = light(LightKind::Distant { angle_degrees: 10.0 });
    desc.prim.transform =
        DMat4::from_scale_rotation_translation(DVec3::splat(3.0), DQuat::from_rotation_x(-PI / 2.0), DVec3::ONE);
    let (direction, radiance, one_minus_cos) = distant(&desc);
    assert!((DVec3::from(direction.map(f64::from)) - DVec3::Y).length() < 1e-6, "{direction:?}");
    assert_eq!(radiance, [12.0, 6.0, 3.0]);
    assert!((f64::from(one_minus_cos) / (1.0 - 5.0_f64.to_radians().cos()) - 1.0).abs() < 1e-7);
}

/// Irradiance on a facing surface of a cone of radiance L and half angle t is pi sin^2 t L up to 90 degrees.
#[test]
fn normalised_lights_give_irradiance_of_one_whatever_their_angle() {
    for angle in [0.0_f32, 1e-6, 1e-3, 0.53, 5.0, 60.0, 180.0, 270.0] {
        let mut desc = light(LightKind::Distant { angle_degrees: angle });
        (desc.normalize, desc.color, desc.intensity, desc.exposure) = (true, [1.0; 3], 1.0, 0.0);
        let (_, radiance, one_minus_cos) = distant(&desc);
        let half = f64::from(angle).to_radians() / 2.0;
        let size = PI * if half <= PI / 2.0 { half.sin().powi(2) } else { 2.0 - half.sin().powi(2) };
        if angle < 1e-5 {
            assert_eq!((one_minus_cos.to_bits(), radiance), (0, [1.0; 3]), "{angle}");
        } else {
            assert!((f64::from(radiance[0]) * size - 1.0).abs() < 1e-6, "{angle}: {radiance:?}");
        }
    }
}

#[test]
fn tiny_angles_become_directions_of_the_same_irradiance() {
    let mut desc = light(LightKind::Distant { angle_degrees: 1e-5 });
    (desc.color, desc.intensity, desc.exposure) = ([1.0; 3], 1e15, 0.0);
    let (_, radiance, one_minus_cos) = distant(&desc);
    let irradiance = 1e15 * PI * (f64::from(1e-5_f32) / 2.0).to_radians().sin().powi(2);
    assert_eq!(one_minus_cos.to_bits(), 0);
    assert!((f64::from(radiance[0]) / irradiance - 1.0).abs() < 1e-6, "{radiance:?} {irradiance}");
}

/// Chromaticities of the Planckian locus (CIE 1931 2-degree), as tabulated by Wyszecki and Stiles and others.
#[test]
fn black_bodies_lie_on_the_planckian_locus() {
    let locus = [
        (2000.0, 0.5267, 0.4133),
        (3000.0, 0.4369, 0.4041),
        (5000.0, 0.3451, 0.3516),
        (6500.0, 0.3135, 0.3237),
        (10000.0, 0.2807, 0.2884),
    ];
    for (kelvin, x, y) in locus {
        let [r, g, b] = blackbody(kelvin).unwrap();
        // Linear Rec. 709 to XYZ (IEC 61966-2-1).
        let xyz = DVec3::new(
            0.4124 * r + 0.3576 * g + 0.1805 * b,
            0.2126 * r + 0.7152 * g + 0.0722 * b,
            0.0193 * r + 0.1192 * g + 0.9505 * b,
        );
        let sum = xyz.element_sum();
        assert!((xyz.x / sum - x).abs() < 1e-3 && (xyz.y / sum - y).abs() < 1e-3, "{kelvin}: {}", xyz / sum);
        assert!((xyz.y - 1.0).abs() < 1e-3, "luminance {}", xyz.y);
    }
}

#[test]
fn black_bodies_clamp_and_never_go_negative() {
    assert_eq!(blackbody(500.0), blackbody(1000.0));
    assert_eq!(blackbody(1e9), blackbody(10000.0));
    assert_eq!(blackbody(f32::INFINITY), blackbody(10000.0));
    assert_eq!(blackbody(f32::NAN), None);
    let ember = blackbody(1000.0).unwrap();
    assert!(ember[0] > 4.0 && ember[2].to_bits() == 0.0_f64.to_bits(), "{ember:?}");
    let [r, _, b] = blackbody(10000.0).unwrap();
    assert!(b > r, "hot is blue");
    let mut desc = light(LightKind::PLAIN_DOME);
    desc.color_temperature = Some(3000.0);
    let tint = blackbody(3000.0).unwrap();
    let radiance = Light::from_desc(&desc).expect("a dome").radiance;
    assert!((f64::from(radiance[1]) - 6.0 * tint[1]).abs() < 1e-5, "{radiance:?}");
}

#[test]
fn features_follow_the_lights_and_meshes() {
    let mut db = SceneDb::new();
    db.upsert_light(light(LightKind::PLAIN_DOME));
    assert_eq!(committed(&mut db).features, Features::DOME);
    db.upsert_light(light(LightKind::Distant { angle_degrees: 0.0 }));
    let mut mesh = crate::support::triangle("/m", 0.0);
    mesh.double_sided = false;
    mesh.display_color = Some(crate::support::constant([0.5_f32; 3]));
    mesh.display_opacity = Some(crate::support::constant(0.5_f32));
    mesh.normals = Some(crate::support::constant([0.0_f32, 0.0, 1.0]));
    db.upsert_mesh(mesh);
    let expected = Features::DISTANT | Features::OPACITY | Features::NORMALS | Features::COLORS;
    assert_eq!(committed(&mut db).features, expected);
}
