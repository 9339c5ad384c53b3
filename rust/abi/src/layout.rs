// SPDX-License-Identifier: Apache-2.0
//! The structs that host and shaders share: the macro that declares them, and their list.
//!
//! Guarantees: a struct of `shared!` is declared once. The build writes its twin for the shaders
//! (`generated/structs.glsl`), and compares offsets and sizes in the SPIR-V with those that the Rust compiler gives.

use super::*;

/// A member of a struct.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MemberLayout {
    /// Name in Rust and in GLSL.
    pub name: &'static str,
    /// Type in Rust.
    pub rust: &'static str,
    /// Type in GLSL if it does not follow from the one in Rust.
    pub glsl: Option<&'static str>,
    /// Offset in the struct, bytes.
    pub offset: usize,
    /// Bytes of the member.
    pub size: usize,
}

/// The layout of a struct.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StructLayout {
    /// Name in Rust and in GLSL.
    pub name: &'static str,
    /// Size of the struct, and stride of its arrays, bytes.
    pub size: usize,
    /// Members in order.
    pub members: &'static [MemberLayout],
}

/// Declares a struct that the shaders have too. In GLSL arrays of two to four `f32`, and of three `u32`, are vectors;
/// if another type is meant there, it follows the member's: `pub power: [f32; 2] = "float[2]"`.
macro_rules! shared {
    (@glsl) => { None };
    (@glsl $type:literal) => { Some($type) };
    (
        $(#[$attribute:meta])*
        pub struct $name:ident {
            $($(#[$doc:meta])* pub $member:ident: $type:ty $(= $glsl:literal)?,)+
        }
    ) => {
        #[repr(C)]
        $(#[$attribute])*
        pub struct $name {
            $($(#[$doc])* pub $member: $type,)+
        }

        impl $name {
            pub(crate) const LAYOUT: $crate::StructLayout = $crate::StructLayout {
                name: stringify!($name),
                size: size_of::<Self>(),
                members: &[$($crate::MemberLayout {
                    name: stringify!($member),
                    rust: stringify!($type),
                    glsl: shared!(@glsl $($glsl)?),
                    offset: core::mem::offset_of!(Self, $member),
                    size: size_of::<$type>(),
                }),+],
            };
        }
    };
}

/// Every struct that host and shaders share, after the structs of its members.
pub const LAYOUTS: &[StructLayout] = &[
    PushConstants::LAYOUT,
    TextureFeedback::LAYOUT,
    AdaptiveSampling::LAYOUT,
    AovTargets::LAYOUT,
    AovClear::LAYOUT,
    PlaneOffsets::LAYOUT,
    PlaneSum::LAYOUT,
    IdSlot::LAYOUT,
    DeepSlot::LAYOUT,
    FrameConstants::LAYOUT,
    ClipPlane::LAYOUT,
    StreamingPointers::LAYOUT,
    UnitDemand::LAYOUT,
    RouletteStats::LAYOUT,
    PathSegment::LAYOUT,
    PendingItems::LAYOUT,
    DeferredAlphaTest::LAYOUT,
    GpuSurface::LAYOUT,
    Bvh4Node::LAYOUT,
    LevelNode::LAYOUT,
    GpuChunkMember::LAYOUT,
    GpuHeldChunk::LAYOUT,
    GpuRefittedChunk::LAYOUT,
    PlacingPush::LAYOUT,
    GpuTriangle::LAYOUT,
    GpuPoint::LAYOUT,
    GpuInstance::LAYOUT,
    GpuMotionKey::LAYOUT,
    GpuCameraMotion::LAYOUT,
    GpuCameraKey::LAYOUT,
    GpuMesh::LAYOUT,
    GpuInput::LAYOUT,
    GpuCutout::LAYOUT,
    GpuMaterial::LAYOUT,
    GpuPrim::LAYOUT,
    GpuAttribute::LAYOUT,
    GpuSurfaceMaterial::LAYOUT,
    GpuAssembly::LAYOUT,
    LightTablePointers::LAYOUT,
    GpuLightKey::LAYOUT,
    GpuMeshLight::LAYOUT,
    GpuLightMesh::LAYOUT,
    GpuLightLeaf::LAYOUT,
    GpuLightTriangle::LAYOUT,
    GpuLightValue::LAYOUT,
    GpuLocalLight::LAYOUT,
    GpuInfiniteLight::LAYOUT,
    GpuLightNode::LAYOUT,
    GpuLightShaping::LAYOUT,
    GpuLightMap::LAYOUT,
    GpuCdf::LAYOUT,
    GpuChunk::LAYOUT,
    GpuTexture::LAYOUT,
    GpuChunkInstance::LAYOUT,
    Ray::LAYOUT,
    PathState::LAYOUT,
    GpuPathAutomaton::LAYOUT,
    GpuPathStates::LAYOUT,
    ShadowRay::LAYOUT,
    IndirectArgs::LAYOUT,
    WavefrontCounters::LAYOUT,
    FilmPixel::LAYOUT,
    ErrorSums::LAYOUT,
    ExactPixel::LAYOUT,
];
