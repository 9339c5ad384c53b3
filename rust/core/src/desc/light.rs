// SPDX-License-Identifier: Apache-2.0
//! Lights as the host describes them, in the terms of UsdLux.

use std::sync::Arc;

use super::{AssetRef, PrimDesc};

/// How the picture of a dome is laid out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum DomeFormat {
    /// Told from the file; here always latlong.
    #[default]
    Automatic,
    /// Longitude and latitude.
    Latlong,
    /// The world in a mirror ball, seen from +z.
    MirroredBall,
    /// The angle to +z from the middle to the rim.
    Angular,
    /// Six faces of a cube on a cross that stands.
    CubeMapVerticalCross,
    /// Something else, which is read as [`Self::Latlong`].
    Other,
}

/// Kinds of light.
#[derive(Clone, Debug, PartialEq)]
pub enum LightKind {
    /// Environment.
    Dome {
        /// Multiplies the radiance; none: constant.
        texture: Option<AssetRef>,
        /// Layout of the texture.
        format: DomeFormat,
    },
    /// Light from a cone of directions around the local +z axis (it shines along -z).
    Distant {
        /// Full angle of the cone, degrees; 0 = exactly one direction.
        angle_degrees: f32,
    },
    /// A rectangle in the local xy plane around the origin; it shines along -z.
    Rect {
        /// Along x.
        width: f32,
        /// Along y.
        height: f32,
        /// Multiplies the radiance.
        texture: Option<AssetRef>,
    },
    /// A sphere around the origin.
    Sphere {
        /// Radius.
        radius: f32,
        /// Infinitely small.
        treat_as_point: bool,
    },
    /// A disk in the local xy plane around the origin; it shines along -z.
    Disk {
        /// Radius.
        radius: f32,
    },
    /// A cylinder around the local x axis, without caps, the origin in its middle.
    Cylinder {
        /// Along x.
        length: f32,
        /// Radius.
        radius: f32,
        /// Infinitely thin.
        treat_as_line: bool,
    },
    /// A mesh, by `MeshLightAPI`: the one whose path, with [`crate::scene::MESH_LIGHT`] behind it, is the light's. What
    /// places and shapes a light does not count.
    Mesh {
        /// How the light and the mesh's material go together.
        sync: MaterialSync,
    },
    /// Half of a square in the local xy plane, its right angle at (-side / 2, -side / 2); it shines along -z. Tests
    /// alone have it.
    #[cfg(feature = "faults")]
    ToyLight {
        /// Of the square.
        side: f32,
    },
}

/// `light:materialSyncMode`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MaterialSync {
    /// The material's emission times the light's.
    GlowTintsLight,
    /// The light's emission; the material reflects.
    Independent,
    /// The light's emission alone.
    NoResponse,
}

impl LightKind {
    /// A dome without a texture.
    pub const PLAIN_DOME: Self = Self::Dome { texture: None, format: DomeFormat::Automatic };
}

/// Where a light shines, about its local -z axis (`UsdLuxShapingAPI`).
#[derive(Clone, Debug, PartialEq)]
pub struct ShapingCone {
    /// Half angle of the cone; 180 and more: no cone.
    pub cone_angle_degrees: f32,
    /// Share of the cone over which it fades out.
    pub cone_softness: f32,
    /// Exponent of the cosine to the axis, forwards and backwards.
    pub focus: f32,
    /// Tints what the exponent takes away.
    pub focus_tint: [f32; 3],
    /// An IES profile.
    pub ies: Option<AssetRef>,
    /// Scales the angles of the profile.
    pub ies_angle_scale: f32,
    /// Divides the profile by its mean, so that the light keeps its power.
    pub ies_normalize: bool,
}

/// How far from what casts it a shadow reaches (`shadow:distance`, `shadow:falloff`, `shadow:falloffGamma` of
/// `UsdLuxShadowAPI`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadowReach {
    /// Distance, in units of the scene, from which on there is none; 0: no shadow at all.
    pub distance: f32,
    /// Length of the stretch before that over which it fades out; 0 and less: none.
    pub falloff: f32,
    /// Exponent of the share of that stretch that is left.
    pub gamma: f32,
}

/// A light with the `UsdLux` inputs.
#[derive(Clone, Debug, PartialEq)]
pub struct LightDesc {
    /// Path, placement, visibility.
    pub prim: PrimDesc,
    /// Kind.
    pub kind: LightKind,
    /// Linear Rec. 709.
    pub color: [f32; 3],
    /// Multiplier.
    pub intensity: f32,
    /// Stops.
    pub exposure: f32,
    /// Kelvin, if colour temperature is enabled.
    pub color_temperature: Option<f32>,
    /// Divide by the size of the light.
    pub normalize: bool,
    /// Seen directly by camera rays.
    pub camera_visible: bool,
    /// Multiplier of diffuse reflection.
    pub diffuse: f32,
    /// Multiplier of specular reflection.
    pub specular: f32,
    /// Where it shines; none: everywhere its kind does.
    pub shaping: Option<ShapingCone>,
    /// False: nothing shadows it.
    pub shadow_enable: bool,
    /// Colour of its shadows.
    pub shadow_color: [f32; 3],
    /// How far its shadows reach; none: without end.
    pub shadow_reach: Option<ShadowReach>,
    /// Category of the prims it lights; none or empty: all.
    pub light_link: Option<Arc<str>>,
    /// Category of the prims that shadow it; none or empty: all.
    pub shadow_link: Option<Arc<str>>,
}
