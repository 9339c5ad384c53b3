// SPDX-License-Identifier: Apache-2.0
//! The images a render produces (Hydra: arbitrary output variables), their formats and where they come from.
//!
//! All images are tightly packed, native endian, bottom row first as Hydra's render buffers expect.
//! `Color` is averaged over samples; every other image is traced once through pixel centres with a pinhole camera, so
//! that ids and depth are exact and do not depend on sampling.

/// One kind of image: tightly packed, native endian, bottom row first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum AovKind {
    /// Linear Rec.709 radiance, premultiplied by alpha; 4 x f32.
    Color,
    /// Clip-space depth mapped to 0 (near) .. 1 (far); f32.
    Depth,
    /// Distance along the view axis, scene units; f32.
    CameraDepth,
    /// Hydra's prim id of the mesh; i32, -1 on a miss.
    PrimId,
    /// Flat instance index, outer instancer slowest (as `HdEmbree` numbers them); i32, -1 on a miss.
    InstanceId,
    /// Authored face index; i32, -1 on a miss.
    ElementId,
    /// Shading normal in world space; 3 x f32.
    Normal,
    /// Shading normal in camera space; 3 x f32.
    Neye,
    /// Diffuse albedo; 3 x f32.
    Albedo,
    /// The distance that a visible point moves over the image from the shutter's opening to its closing: pixels to the
    /// right, pixels up, and the change of `CameraDepth`; 3 x f32.
    Motion,
    /// Samples of the pixel so far (`sampleCount`, as `RenderMan` names it); f32. Samples are taken for it as for
    /// `Color`.
    SampleCount,
}

impl AovKind {
    /// Every kind, in the order of the enum.
    pub const ALL: [Self; 11] = [
        Self::Color,
        Self::Depth,
        Self::CameraDepth,
        Self::PrimId,
        Self::InstanceId,
        Self::ElementId,
        Self::Normal,
        Self::Neye,
        Self::Albedo,
        Self::Motion,
        Self::SampleCount,
    ];

    /// Hydra's token for this image (`HdAovTokens`, and names of our own for what it has none for).
    pub fn token(self) -> &'static str {
        match self {
            Self::Color => "color",
            Self::Depth => "depth",
            Self::CameraDepth => "cameraDepth",
            Self::PrimId => "primId",
            Self::InstanceId => "instanceId",
            Self::ElementId => "elementId",
            Self::Normal => "normal",
            Self::Neye => "Neye",
            Self::Albedo => "albedo",
            Self::Motion => "motion",
            Self::SampleCount => "sampleCount",
        }
    }

    /// The kind named by Hydra's token, if OocPT renders it.
    pub fn from_token(token: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.token() == token)
    }

    /// Bytes of one pixel.
    pub fn pixel_bytes(self) -> usize {
        4 * self.channels()
    }

    /// 32-bit channels of one pixel.
    pub fn channels(self) -> usize {
        match self {
            Self::Color => 4,
            Self::Normal | Self::Neye | Self::Albedo | Self::Motion => 3,
            Self::Depth | Self::CameraDepth | Self::PrimId | Self::InstanceId | Self::ElementId | Self::SampleCount => {
                1
            }
        }
    }
}

/// A requested image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AovRequest {
    /// The kind of image.
    pub kind: AovKind,
    /// Value of a pixel that nothing covers, in the image's own units; for ids the first entry, rounded.
    /// For `Color` it is the premultiplied background that shows through where alpha is below one.
    pub clear: [f32; 4],
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_are_distinct_and_round_trip() {
        for kind in AovKind::ALL {
            assert_eq!(AovKind::from_token(kind.token()), Some(kind), "{kind:?} does not round trip");
        }
        assert_eq!(AovKind::from_token("primvars:st"), None, "an unknown token must not map to a kind");
    }
}
