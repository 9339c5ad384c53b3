// SPDX-License-Identifier: Apache-2.0
//! The images a render produces (Hydra: arbitrary output variables), their formats and where they come from.
//!
//! All images are tightly packed, native endian, bottom row first as Hydra's render buffers expect.
//! `Color` is averaged over samples, and with it the images that are filtered ([`AovKind::is_filterable`]); every other
//! image is traced once through pixel centres with a pinhole camera, so that ids and depth are exact and do not depend
//! on sampling.

use crate::job::deep::DeepLimits;
use crate::job::expression::ExpressionId;
use crate::job::primvar::PrimvarImage;
use oocpt_abi::{CATCHER_WORDS, DeepSlot, SHADOW_WORDS, WAIT_WORDS};

macro_rules! aov_kinds {
    ($($(#[doc = $doc:literal])+ $name:ident: $token:literal, $channels:literal;)+) => {
        /// One kind of image: tightly packed, native endian, bottom row first.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum AovKind {
            $($(#[doc = $doc])+ $name,)+
            /// A primvar of what is seen: missing components are 0 and the fourth 1, those of a single number alike;
            /// all 0 where nothing has it; f32.
            Primvar(PrimvarImage),
            /// The part of `Color` that a light path expression is of, without alpha; f32.
            Light(ExpressionId),
            /// What samples meet first, by thing and depth: [`oocpt_abi::DeepSlot`], as many a pixel as the limits say,
            /// in no order; zero where there are fewer.
            Deep(DeepLimits),
        }

        impl AovKind {
            /// Every kind but primvars, parts of light and deep images, in the order of the enum.
            pub const ALL: [Self; [$(Self::$name),+].len()] = [$(Self::$name),+];

            /// Hydra's token for this image (`HdAovTokens`, and names of our own for what it has none for); one for all
            /// parts of light.
            pub fn token(self) -> &'static str {
                match self {
                    $(Self::$name => $token,)+
                    Self::Primvar(_) => "primvar",
                    Self::Light(_) => "light",
                    Self::Deep(_) => "deep",
                }
            }

            /// 32-bit channels of one pixel.
            pub fn channels(self) -> usize {
                match self {
                    $(Self::$name => $channels,)+
                    Self::Primvar(_) => 4,
                    Self::Light(_) => 3,
                    Self::Deep(limits) => size_of::<DeepSlot>() / 4 * usize::from(limits.samples()),
                }
            }
        }
    };
}

// A row is a kind, Hydra's token for it, and its number of 32-bit channels.
aov_kinds! {
    /// Linear Rec.709 radiance, premultiplied by alpha; f32.
    Color: "color", 4;
    /// Clip-space depth mapped to 0 (near) .. 1 (far); f32.
    Depth: "depth", 1;
    /// Distance along the view axis, scene units; f32.
    CameraDepth: "cameraDepth", 1;
    /// Hydra's prim id of the mesh; i32, -1 on a miss.
    PrimId: "primId", 1;
    /// Flat instance index, outer instancer slowest (as `HdEmbree` numbers them); i32, -1 on a miss.
    InstanceId: "instanceId", 1;
    /// Authored face index; i32, -1 on a miss.
    ElementId: "elementId", 1;
    /// Shading normal in world space; f32.
    Normal: "normal", 3;
    /// Shading normal in camera space; f32.
    Neye: "Neye", 3;
    /// Diffuse albedo; f32.
    Albedo: "albedo", 3;
    /// The distance that a visible point moves over the image from the shutter's opening to its closing: pixels to the
    /// right, pixels up, and the change of `CameraDepth`; f32.
    Motion: "motion", 3;
    /// The same distance in two parts: pixels to the right and up from the shutter's opening to the pixel's centre,
    /// which the point is at in the middle of the shutter, and from there to its closing; f32.
    MotionBoth: "motionBoth", 4;
    /// Samples of the pixel so far (`sampleCount`, as `RenderMan` names it); f32. Samples are taken for it as for
    /// `Color`.
    SampleCount: "sampleCount", 1;
    /// Point of the surface in world space; f32.
    Position: "position", 3;
    /// The same in camera space; f32.
    Peye: "Peye", 3;
    /// Normal in world space of the surface as it is traced, without interpolation or normal maps; f32.
    GeometricNormal: "Ng", 3;
    /// Variance of the pixel's samples, by channel, in units of the square of `Color`; f32. 0 below two samples.
    Variance: "variance", 3;
    /// Estimated standard error of the pixel relative to its value; the mean of its squares over the image is the told
    /// relMSE; f32. 0 below two samples.
    Error: "error", 1;
    /// The largest shares of the pixel by placement of a prim ([`oocpt_abi::ID_RANKS`] of [`oocpt_abi::IdSlot`]): prim
    /// id + 1 and instance id as u32, and the share as f32; zero where there are fewer. For Cryptomatte.
    CryptoObject: "cryptoObject", 18;
    /// The same by material: its number + 1, 0, and the share.
    CryptoMaterial: "cryptoMaterial", 18;
    /// Number of the material of the surface; i32, -1 where there is none.
    MaterialId: "materialId", 1;
    /// The share of the light that lamps and domes send to what samples meet first which does not arrive, by channel
    /// and of the luminance; f32, 0 where no light could arrive.
    Shadow: "shadow", 4;
    /// What shadow catchers have of `Color`'s alpha: their share of the pixel times the share of the light that does
    /// not arrive at them; f32.
    ShadowCatcher: "shadowCatcher", 1;
    /// How often the rays and materials of a sample waited for chunks, meshes or tiles of textures to be loaded: the
    /// mean of the pixel's samples; f32. It depends on the memory and the timing of loads.
    LoadWaits: "loadWaits", 1;
    /// `Color` as the denoiser makes it (`crate::denoiser`); it is `Color` itself on the way and where there is none.
    Denoised: "denoised", 4;
}

impl AovKind {
    /// The kind named by Hydra's token, if OocPT renders it; behind `lpe:` a light path expression,
    /// behind `primvars:` a primvar.
    pub fn from_token(token: &str) -> Option<Self> {
        if token.starts_with("lpe:") {
            return ExpressionId::of(token).map(Self::Light).ok();
        }
        if token.starts_with("primvars:") {
            return PrimvarImage::of(token, false).map(Self::Primvar).ok();
        }
        Self::ALL.into_iter().find(|kind| kind.token() == token)
    }

    /// The token; or `lpe:` and the expression, `primvars:` and the name.
    pub fn name(self) -> String {
        match self {
            Self::Light(expression) => format!("lpe:{}", expression.text()),
            Self::Primvar(primvar) => format!("primvars:{}", primvar.name()),
            Self::Deep(limits) => format!("deep:{limits}"),
            kind => kind.token().to_owned(),
        }
    }

    /// The primvar whose image it is.
    pub(crate) fn primvar(self) -> Option<PrimvarImage> {
        if let Self::Primvar(primvar) = self { Some(primvar) } else { None }
    }

    /// The light path expression whose image it is.
    pub(crate) fn expression(self) -> Option<ExpressionId> {
        if let Self::Light(expression) = self { Some(expression) } else { None }
    }

    /// The limits of a deep image.
    pub(crate) fn deep(self) -> Option<DeepLimits> {
        if let Self::Deep(limits) = self { Some(limits) } else { None }
    }

    /// Whether a pixel of the image is a list, which is empty where nothing is.
    pub(crate) fn is_list(self) -> bool {
        self.ranks_ids() || self.deep().is_some()
    }

    /// Whether the image is of values that samples have beside their light; `filters`: as
    /// [`oocpt_core::settings::Settings::filter_aovs`] says.
    pub(crate) fn is_of_samples(self, filters: bool) -> bool {
        filters && self.is_filterable() || self.expression().is_some() || self.is_list() || self.is_of_paths()
    }

    /// Whether the image is made of the light that shadow rays ask for, and of what of it arrives.
    pub(crate) fn is_of_shadows(self) -> bool {
        matches!(self, Self::Shadow | Self::ShadowCatcher)
    }

    /// Whether the image is of what happens to a sample's rays on their way.
    fn is_of_paths(self) -> bool {
        self.is_of_shadows() || self == Self::LoadWaits
    }

    /// Values of a sample that are summed for an image of samples that is no list.
    pub(crate) fn summed_words(self) -> u32 {
        match self {
            Self::Shadow => SHADOW_WORDS,
            Self::ShadowCatcher => CATCHER_WORDS,
            Self::LoadWaits => WAIT_WORDS,
            // At most four.
            kind => u32::try_from(kind.channels()).unwrap_or(0),
        }
    }

    /// Whether a pixel is a whole number.
    pub fn is_id(self) -> bool {
        matches!(self, Self::PrimId | Self::InstanceId | Self::ElementId | Self::MaterialId)
    }

    /// Whether the image is the mean over a pixel's samples of what each meets first, where
    /// [`oocpt_core::settings::Settings::filter_aovs`] is set; the mean of ids, depths or vectors of motion at an edge
    /// is that of no surface.
    pub fn is_filterable(self) -> bool {
        let is_mean = self.primvar().is_some_and(|primvar| !primvar.is_centred);
        is_mean
            || matches!(self, Self::Normal | Self::Neye | Self::Albedo)
            || matches!(self, Self::Position | Self::Peye | Self::GeometricNormal)
    }

    /// Whether the image ranks the ids of what the samples meet first, whatever the setting says.
    pub fn ranks_ids(self) -> bool {
        matches!(self, Self::CryptoObject | Self::CryptoMaterial)
    }

    /// Whether the image says something of the samples of `Color`, or is a part of it.
    pub(crate) fn is_of_light(self) -> bool {
        let tells = matches!(self, Self::Denoised | Self::SampleCount | Self::Variance | Self::Error);
        tells || self.is_of_paths() || matches!(self, Self::Color | Self::Light(_) | Self::Deep(_))
    }

    /// Hydra's usual value of a pixel that nothing covers.
    pub fn default_clear(self) -> [f32; 4] {
        match self {
            Self::Depth => [1.0; 4],
            kind if kind.is_id() => [-1.0; 4],
            _ => [0.0; 4],
        }
    }

    /// Bytes of one pixel.
    pub fn pixel_bytes(self) -> usize {
        4 * self.channels()
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
        let part = AovKind::from_token("lpe:C <RD> L").expect("an expression");
        assert_eq!((part.name().as_str(), AovKind::from_token(&part.name())), ("lpe:C<RD>L", Some(part)));
        assert_eq!(AovKind::from_token("lpe:C<"), None, "no expression");
        let st = AovKind::from_token("primvars:st").expect("a primvar");
        assert_eq!((st.name().as_str(), st.is_filterable(), st.is_of_light()), ("primvars:st", true, false));
        assert_eq!([AovKind::from_token("primvars:"), AovKind::from_token("st")], [None; 2], "no kind");
    }

    #[test]
    fn depth_and_ids_have_their_own_clear_values() {
        assert!(AovKind::Depth.default_clear()[0] > 0.5, "depth is far");
        assert!(AovKind::PrimId.default_clear()[0] < 0.0, "ids are none");
        assert!(AovKind::Color.default_clear().iter().all(|component| component.abs() < 1e-9), "color is empty");
    }
}
