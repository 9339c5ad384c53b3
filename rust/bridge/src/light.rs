// SPDX-License-Identifier: Apache-2.0
//! Turns lights that cross the boundary into the core's descriptions. Pure; any thread.

use crate::convert::{asset, optional_text, prim};
use crate::ffi;
use oocpt_core::scene::{DomeFormat, LightDesc, LightKind, MaterialSync, ShadowReach, ShapingCone};

fn light_kind(desc: &mut ffi::LightDesc) -> LightKind {
    let texture =
        std::mem::replace(&mut desc.texture, ffi::AssetDesc { authored: String::new(), resolved: String::new() });
    let texture = asset(texture);
    match desc.kind {
        ffi::LightTag::Distant => LightKind::Distant { angle_degrees: desc.angle_degrees },
        ffi::LightTag::Rect => LightKind::Rect { width: desc.width, height: desc.height, texture },
        ffi::LightTag::Sphere => LightKind::Sphere { radius: desc.radius, treat_as_point: desc.treat_as_point },
        ffi::LightTag::Disk => LightKind::Disk { radius: desc.radius },
        ffi::LightTag::Cylinder => {
            LightKind::Cylinder { length: desc.length, radius: desc.radius, treat_as_line: desc.treat_as_line }
        }
        ffi::LightTag::GlowTintedMesh => LightKind::Mesh { sync: MaterialSync::GlowTintsLight },
        ffi::LightTag::IndependentMesh => LightKind::Mesh { sync: MaterialSync::Independent },
        ffi::LightTag::LightOnlyMesh => LightKind::Mesh { sync: MaterialSync::NoResponse },
        _ => LightKind::Dome { texture, format: dome_format(&desc.format) },
    }
}

/// `texture:format` of a dome.
fn dome_format(token: &str) -> DomeFormat {
    match token {
        "" | "automatic" => DomeFormat::Automatic,
        "latlong" => DomeFormat::Latlong,
        "mirroredBall" => DomeFormat::MirroredBall,
        "angular" => DomeFormat::Angular,
        "cubeMapVerticalCross" => DomeFormat::CubeMapVerticalCross,
        _ => DomeFormat::Other,
    }
}

fn shaping(desc: ffi::ShapingDesc) -> ShapingCone {
    ShapingCone {
        cone_angle_degrees: desc.cone_angle_degrees,
        cone_softness: desc.cone_softness,
        focus: desc.focus,
        focus_tint: desc.focus_tint,
        ies: asset(desc.ies),
        ies_angle_scale: desc.ies_angle_scale,
        ies_normalize: desc.ies_normalize,
    }
}

/// The reach from distance, falloff and its gamma. Negative distances are no limit, as `UsdLux` says -1 by default.
fn shadow_reach([distance, falloff, gamma]: [f32; 3]) -> Option<ShadowReach> {
    (distance >= 0.0 && distance.is_finite()).then_some(ShadowReach { distance, falloff, gamma })
}

/// The core's light.
pub(crate) fn light(mut desc: ffi::LightDesc) -> LightDesc {
    let kind = light_kind(&mut desc);
    LightDesc {
        prim: prim(desc.prim),
        kind,
        color: desc.color,
        intensity: desc.intensity,
        exposure: desc.exposure,
        color_temperature: desc.enable_color_temperature.then_some(desc.color_temperature),
        normalize: desc.normalize,
        camera_visible: desc.camera_visible,
        diffuse: desc.diffuse,
        specular: desc.specular,
        shaping: desc.has_shaping.then(|| shaping(desc.shaping)),
        shadow_enable: desc.shadow_enable,
        shadow_color: desc.shadow_color,
        shadow_reach: shadow_reach(desc.shadow_reach),
        light_link: optional_text(desc.light_link),
        shadow_link: optional_text(desc.shadow_link),
        label: optional_text(desc.label),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convert::tests::prim_desc;
    use oocpt_core::scene::AssetRef;

    fn no_asset() -> ffi::AssetDesc {
        ffi::AssetDesc { authored: String::new(), resolved: String::new() }
    }

    fn light_desc(kind: ffi::LightTag) -> ffi::LightDesc {
        ffi::LightDesc {
            prim: prim_desc(),
            kind,
            angle_degrees: 0.53,
            width: 2.0,
            height: 3.0,
            radius: 0.25,
            length: 4.0,
            treat_as_point: true,
            treat_as_line: true,
            texture: ffi::AssetDesc { authored: "a.exr".into(), resolved: "/t/a.exr".into() },
            format: "latlong".into(),
            diffuse: 0.5,
            specular: 0.75,
            has_shaping: false,
            shaping: ffi::ShapingDesc {
                cone_angle_degrees: 30.0,
                cone_softness: 0.1,
                focus: 2.0,
                focus_tint: [0.1, 0.2, 0.3],
                ies: no_asset(),
                ies_angle_scale: 0.5,
                ies_normalize: true,
            },
            shadow_enable: false,
            shadow_color: [0.0, 0.5, 0.0],
            shadow_reach: [-1.0, -1.0, 1.0],
            light_link: "/L.collection:lightLink".into(),
            shadow_link: String::new(),
            label: "key".into(),
            color: [1.0; 3],
            intensity: 2.0,
            exposure: 1.0,
            enable_color_temperature: false,
            color_temperature: 3000.0,
            normalize: false,
            camera_visible: true,
        }
    }

    #[test]
    fn color_temperature_counts_only_when_enabled() {
        let desc = |enable_color_temperature| ffi::LightDesc {
            enable_color_temperature,
            ..light_desc(ffi::LightTag::Distant)
        };
        assert_eq!(light(desc(false)).color_temperature, None, "disabled");
        assert_eq!(light(desc(true)).color_temperature, Some(3000.0), "enabled");
        assert_eq!(light(desc(true)).kind, LightKind::Distant { angle_degrees: 0.53 }, "the angle");
    }

    #[test]
    fn each_light_kind_reads_only_its_own_inputs() {
        let texture = || Some(AssetRef { authored: "a.exr".into(), resolved: "/t/a.exr".into() });
        let kinds = [
            (ffi::LightTag::Dome, LightKind::Dome { texture: texture(), format: DomeFormat::Latlong }),
            (ffi::LightTag::Rect, LightKind::Rect { width: 2.0, height: 3.0, texture: texture() }),
            (ffi::LightTag::Sphere, LightKind::Sphere { radius: 0.25, treat_as_point: true }),
            (ffi::LightTag::Disk, LightKind::Disk { radius: 0.25 }),
            (ffi::LightTag::Cylinder, LightKind::Cylinder { length: 4.0, radius: 0.25, treat_as_line: true }),
        ];
        for (tag, kind) in kinds {
            assert_eq!(light(light_desc(tag)).kind, kind, "kind");
        }
        let plain = ffi::LightDesc { texture: no_asset(), ..light_desc(ffi::LightTag::Rect) };
        assert_eq!(light(plain).kind, LightKind::Rect { width: 2.0, height: 3.0, texture: None }, "no texture");
    }

    #[test]
    fn shadow_distance_is_converted() {
        let desc = |distance| ffi::LightDesc { shadow_reach: [distance, -1.0, 1.0], ..light_desc(ffi::LightTag::Disk) };
        let reach = |distance| light(desc(distance));
        let expected = ShadowReach { distance: 2.0, falloff: -1.0, gamma: 1.0 };
        assert_eq!(reach(2.0).shadow_reach, Some(expected), "as authored");
        for none in [-1.0, f32::NAN, f32::INFINITY] {
            assert_eq!(reach(none).shadow_reach, None, "{none} is no limit");
        }
    }

    #[test]
    fn links_and_shaping_are_none_unless_authored() {
        let plain = light(light_desc(ffi::LightTag::Sphere));
        assert_eq!(plain.shaping, None, "no shaping");
        assert_eq!(plain.light_link.as_deref(), Some("/L.collection:lightLink"), "the category of the link");
        assert_eq!(plain.label.as_deref(), Some("key"), "the light group");
        assert_eq!(plain.shadow_link, None, "an empty category is everything");
        assert!(!plain.shadow_enable, "shadows are off");
        assert_eq!((plain.diffuse, plain.specular), (0.5, 0.75), "multipliers");
        let shaped = light(ffi::LightDesc { has_shaping: true, ..light_desc(ffi::LightTag::Sphere) });
        let shaping = shaped.shaping.expect("shaping is there");
        assert_eq!((shaping.cone_angle_degrees, shaping.focus, shaping.ies), (30.0, 2.0, None), "shaping");
    }
}
