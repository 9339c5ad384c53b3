// SPDX-License-Identifier: Apache-2.0
//! Lights as the host describes them, in the terms of UsdLux.

use std::sync::Arc;

use super::{AssetRef, PrimDesc};

/// Layout of the texture of a dome.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum DomeFormat {
    /// The file decides; here it is always latlong.
    #[default]
    Automatic,
    /// Longitude and latitude.
    Latlong,
    /// The world as seen in a mirror ball from +z.
    MirroredBall,
    /// Distance from the middle is proportional to the angle to +z.
    Angular,
    /// Six faces of a cube on an upright cross.
    CubeMapVerticalCross,
    /// Another layout, which is read as [`Self::Latlong`].
    Other,
}

/// Kinds of light.
#[derive(Clone, Debug, PartialEq)]
pub enum LightKind {
    /// An environment around the scene.
    Dome {
        /// Texture that multiplies the radiance; `None`: constant.
        texture: Option<AssetRef>,
        /// Layout of the texture.
        format: DomeFormat,
    },
    /// Light from a cone of directions around the local +z axis (it emits along -z).
    Distant {
        /// Full angle of the cone, degrees; 0 = exactly one direction.
        angle_degrees: f32,
    },
    /// A rectangle in the local xy plane around the origin; it emits along -z.
    Rect {
        /// Size along x.
        width: f32,
        /// Size along y.
        height: f32,
        /// Texture that multiplies the radiance.
        texture: Option<AssetRef>,
    },
    /// A sphere around the origin.
    Sphere {
        /// Radius in object space.
        radius: f32,
        /// True if it is a point.
        treat_as_point: bool,
    },
    /// A disk in the local xy plane around the origin; it emits along -z.
    Disk {
        /// Radius in object space.
        radius: f32,
    },
    /// A cylinder around the local x axis, without caps, the origin in its middle.
    Cylinder {
        /// Length along x.
        length: f32,
        /// Radius in object space.
        radius: f32,
        /// True if it is a line.
        treat_as_line: bool,
    },
    /// A mesh, by `MeshLightAPI`: the one whose path, with [`crate::scene::MESH_LIGHT`] behind it, is the light's.
    /// Placement and shaping of the light are ignored.
    Mesh {
        /// Combination of the light with the mesh's material.
        sync: MaterialSync,
    },
    /// Half of a square in the local xy plane, with its right angle at (-side / 2, -side / 2); it emits along -z. Only
    /// tests have it.
    #[cfg(feature = "faults")]
    ToyLight {
        /// Side of the square.
        side: f32,
    },
}

/// Values of `light:materialSyncMode`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MaterialSync {
    /// The material's emission times the light's.
    GlowTintsLight,
    /// The light's emission; the material still reflects.
    Independent,
    /// The light's emission alone.
    NoResponse,
}

impl LightKind {
    /// A dome without a texture.
    pub const PLAIN_DOME: Self = Self::Dome { texture: None, format: DomeFormat::Automatic };
}

/// Restriction of a light's directions about its local -z axis (`UsdLuxShapingAPI`).
#[derive(Clone, Debug, PartialEq)]
pub struct ShapingCone {
    /// Half angle of the cone, degrees; 180 and more: no cone.
    pub cone_angle_degrees: f32,
    /// Share of the cone over which the light fades out.
    pub cone_softness: f32,
    /// Exponent of the cosine to the axis, forwards and backwards.
    pub focus: f32,
    /// Tint of the light that the exponent takes away.
    pub focus_tint: [f32; 3],
    /// IES profile.
    pub ies: Option<AssetRef>,
    /// Scale of the profile's angles.
    pub ies_angle_scale: f32,
    /// True if the profile is divided by its mean, so that the light keeps its power.
    pub ies_normalize: bool,
}

/// Length that a shadow reaches from the prim that casts it (`shadow:distance`, `shadow:falloff`, `shadow:falloffGamma`
/// of `UsdLuxShadowAPI`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadowReach {
    /// Distance, in units of the scene, beyond which there is no shadow; 0: no shadow at all.
    pub distance: f32,
    /// Length of the stretch before that over which the shadow fades out; 0 and less: none.
    pub falloff: f32,
    /// Exponent of the share of that stretch that is left.
    pub gamma: f32,
}

/// A light with the `UsdLux` inputs.
#[derive(Clone, Debug, PartialEq)]
pub struct LightDesc {
    /// Path, placement, visibility.
    pub prim: PrimDesc,
    /// Kind of the light.
    pub kind: LightKind,
    /// Colour, linear Rec. 709.
    pub color: [f32; 3],
    /// Multiplier of the radiance.
    pub intensity: f32,
    /// Multiplier of the radiance, in stops.
    pub exposure: f32,
    /// Colour temperature in kelvin, if it is enabled.
    pub color_temperature: Option<f32>,
    /// True if the emission is divided by the size of the light.
    pub normalize: bool,
    /// True if camera rays see it directly.
    pub camera_visible: bool,
    /// Multiplier of diffuse reflection.
    pub diffuse: f32,
    /// Multiplier of specular reflection.
    pub specular: f32,
    /// Restriction of its directions; `None`: it emits wherever its kind does.
    pub shaping: Option<ShapingCone>,
    /// True if prims shadow it.
    pub shadow_enable: bool,
    /// Colour of its shadows.
    pub shadow_color: [f32; 3],
    /// Length that its shadows reach; `None`: without end.
    pub shadow_reach: Option<ShadowReach>,
    /// Category of the prims that it lights; `None` or empty: all.
    pub light_link: Option<Arc<str>>,
    /// Category of the prims that shadow it; `None` or empty: all.
    pub shadow_link: Option<Arc<str>>,
    /// Label in light path expressions: its light group; `None` or empty: none.
    pub label: Option<Arc<str>>,
}
