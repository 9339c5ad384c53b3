// SPDX-License-Identifier: Apache-2.0
//! Inputs of the renderer's BSDF: what surfaces are brought to.

/// Inputs of the renderer's BSDF.
///
/// Of a fibre (`chiang_hair_bsdf`) some mean something else: `DiffuseColor`, `SpecularColor`, `TransmissionColor` are
/// the tints of R, TT and TRT; `Anisotropy` is variance along the fibre and scale of the logistic across it, of R, then
/// of TT; `ThinFilm` the same of TRT, and the tilt of the cuticle in radians; `Absorption` is by the fibre's radius;
/// `Normal` is where a ribbon is met across its width.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(usize)]
pub enum Input {
    /// Diffuse reflectance, and reflectance of the metallic part.
    DiffuseColor = 0,
    /// Radiance.
    EmissiveColor = 1,
    /// Reflectance at normal incidence, in the specular workflow.
    SpecularColor = 2,
    /// Share of metal.
    Metallic = 3,
    /// Of the base.
    Roughness = 4,
    /// Share of the coat.
    Clearcoat = 5,
    /// Of the coat.
    ClearcoatRoughness = 6,
    /// Whether the surface is there.
    Opacity = 7,
    /// Of the base.
    Ior = 8,
    /// In the frame of the surface.
    Normal = 9,
    /// Share of what is not metal that is glass.
    Transmission = 10,
    /// What a refraction is multiplied by.
    TransmissionColor = 11,
    /// Of the coat.
    CoatIor = 12,
    /// Colour of the fuzz, times its weight.
    SheenColor = 13,
    /// Of the fuzz.
    SheenRoughness = 14,
    /// Ratio of the alphas across and along the tangent, turn of the tangent toward the bitangent (1: a whole one); of
    /// the base, then of the coat.
    Anisotropy = 15,
    /// Weight, thickness in nm, index of a film on the base.
    ThinFilm = 16,
    /// Of light inside, per unit of length; of what is dispersive 1 / its Abbe number in the last component.
    Absorption = 17,
    /// Of the diffuse lobe.
    DiffuseRoughness = 18,
}

/// Number of [`Input`].
pub const INPUTS: usize = 19;

impl Input {
    /// All of them, by their numbers.
    pub const ALL: [Self; INPUTS] = [
        Self::DiffuseColor,
        Self::EmissiveColor,
        Self::SpecularColor,
        Self::Metallic,
        Self::Roughness,
        Self::Clearcoat,
        Self::ClearcoatRoughness,
        Self::Opacity,
        Self::Ior,
        Self::Normal,
        Self::Transmission,
        Self::TransmissionColor,
        Self::CoatIor,
        Self::SheenColor,
        Self::SheenRoughness,
        Self::Anisotropy,
        Self::ThinFilm,
        Self::Absorption,
        Self::DiffuseRoughness,
    ];

    /// Components that count.
    #[must_use]
    pub fn width(self) -> usize {
        SHAPES[self as usize].0
    }
}

/// Name for messages, components that count, value where nothing is said; by [`Input`].
pub(crate) const SHAPES: [(usize, [f32; 4]); INPUTS] = [
    (3, [0.8, 0.8, 0.8, 1.0]),
    (3, [0.0, 0.0, 0.0, 1.0]),
    (3, [0.0, 0.0, 0.0, 1.0]),
    (1, [0.0; 4]),
    (1, [0.3; 4]),
    (1, [0.0; 4]),
    (1, [0.0; 4]),
    (1, [1.0; 4]),
    (1, [1.5; 4]),
    (3, [0.0, 0.0, 1.0, 1.0]),
    (1, [0.0; 4]),
    (3, [1.0; 4]),
    (1, [1.5; 4]),
    (3, [0.0, 0.0, 0.0, 1.0]),
    (1, [0.3; 4]),
    (4, [1.0, 0.0, 1.0, 0.0]),
    (3, [0.0, 0.0, 1.4, 0.0]),
    (3, [0.0; 4]),
    (1, [0.0; 4]),
];
