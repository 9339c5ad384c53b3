// SPDX-License-Identifier: Apache-2.0
//! Pattern programs and inputs of materials: the operations, the geometry that a surface provides, and the inputs that
//! are computed. Each has a number, which is its position in its list. Any thread.

/// Largest number of lookups of a program for opacity: with streaming the values of all but one are stored with a ray's
/// deferred alpha test.
pub const CUTOUT_LOOKUPS: u32 = 4;
/// Number of registers of a program, f32x4 each; operands from here on are its constants.
pub const PROGRAM_REGISTERS: u32 = 32;

/// An enum whose variants are numbered in their order. The build writes a `const uint` of each for the shaders:
/// `RgbToHsv` is `PREFIX_RGB_TO_HSV`.
macro_rules! numbered {
    ($(#[$meta:meta])* $name:ident, $prefix:literal { $($(#[doc = $doc:literal])+ $variant:ident,)+ }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[repr(u8)]
        pub enum $name {
            $($(#[doc = $doc])+ $variant,)+
        }

        impl $name {
            /// Number of variants.
            pub const COUNT: usize = [$(stringify!($variant)),+].len();
            /// All variants, by their numbers.
            pub const ALL: [Self; Self::COUNT] = [$(Self::$variant),+];

            /// Names and numbers of the constants in the shaders.
            pub(crate) fn constants() -> impl Iterator<Item = (String, u32)> {
                Self::ALL.into_iter().map(|one| (upper_case($prefix, &format!("{one:?}")), u32::from(one as u8)))
            }
        }
    };
}

/// Converts a name to upper case: `RgbToHsv` is `RGB_TO_HSV`.
fn upper_case(prefix: &str, name: &str) -> String {
    let mut text = String::from(prefix);
    for letter in name.chars() {
        if letter.is_ascii_uppercase() {
            text.push('_');
        }
        text.push(letter.to_ascii_uppercase());
    }
    text
}

numbered! {
    /// An operation of a pattern program. `a`, `b`, `c` are its operands; operations are by component unless said
    /// otherwise. Results that are undefined in `MaterialX` (a division by 0, a root of a negative number) are 0 here.
    /// Results that are not finite are 0, and so are those below 2^-126; there is no -0.
    PatternOp, "PATTERN" {
        /// a.
        Move,
        /// a + b.
        Add,
        /// a - b.
        Subtract,
        /// a b.
        Multiply,
        /// a / b.
        Divide,
        /// a - b floor(a / b).
        Modulo,
        /// |a|.
        Absolute,
        /// Sign of a: -1, 0 or 1.
        Sign,
        /// Largest integer not above a.
        Floor,
        /// Smallest integer not below a.
        Ceil,
        /// floor(a + 0.5), without rounding in between.
        Round,
        /// a - floor(a).
        Fract,
        /// a to the power of b; 1 if b = 0, else 0 if a = 0. For a negative a only with a whole b.
        Power,
        /// Square root.
        Sqrt,
        /// Natural logarithm.
        Ln,
        /// e^a.
        Exp,
        /// Sine of an angle in radians.
        Sin,
        /// Cosine of an angle in radians.
        Cos,
        /// Tangent of an angle in radians.
        Tan,
        /// Arc sine of a, clamped to -1..1.
        Asin,
        /// Arc cosine of a, clamped to -1..1.
        Acos,
        /// Angle of the vector (b, a).
        Atan2,
        /// The lesser of a and b.
        Min,
        /// The greater of a and b.
        Max,
        /// a (1 - c) + b c.
        Mix,
        /// a limited to b..c.
        Clamp,
        /// Hermite step of a from b to c; 1 if a >= c, else 0 if a <= b.
        Smoothstep,
        /// a b + c.
        MultiplyAdd,
        /// Sum of the products of the first `immediate` components, in all components.
        Dot,
        /// Cross product of the first three components; w = 0.
        Cross,
        /// a over its length, of the first `immediate` components; the others are 0. 0 stays 0.
        Normalize,
        /// Length of the first `immediate` components, in all components.
        Length,
        /// 1 where a > b, else 0.
        Greater,
        /// 1 where a >= b, else 0.
        GreaterEqual,
        /// 1 where a = b, else 0.
        Equal,
        /// a where c is not 0, else b.
        Select,
        /// Component k is the one of a that bits 3k to 3k + 2 of `immediate` select: 0 to 3, 4 = the number 0, 5 = the
        /// number 1.
        Swizzle,
        /// Component k is that of b if bit k of `immediate` is set, else that of a.
        Blend,
        /// Hue, saturation, value of a colour, alpha as it is.
        RgbToHsv,
        /// The colour of hue, saturation, value, alpha as it is.
        HsvToRgb,
        /// `MaterialX`'s `mx_perlin_noise_float` (2D) of a.xy in all components.
        Noise2,
        /// `mx_perlin_noise_vec3` (2D) of a.xy in xyz; w: noise of a.xy + (19, 73).
        Noise2Vector,
        /// `mx_perlin_noise_float` (3D) of a.xyz in all components.
        Noise3,
        /// `mx_perlin_noise_vec3` (3D) of a.xyz in xyz; w: noise of a.xyz + (19, 73, 29).
        Noise3Vector,
        /// `mx_cell_noise_float` of a.xy in all components.
        CellNoise2,
        /// `mx_cell_noise_float` of a.xyz in all components.
        CellNoise3,
        /// Worley noise (2D) of a.xy with jitter b.x; `immediate`: 0 F1 in all components, 1 (F1, F2, 0, 0), 2 (F1, F2,
        /// F3, 0), 3 cell noise of the nearest point in all components (`MaterialX`'s style 1), 4 the same as a vector
        /// (`mx_cell_noise_vec3`; w = 0).
        Worley2,
        /// `mx_worley_noise_float` in 3D, of a.xyz.
        Worley3,
        /// Fractal sum of Perlin noise (3D) of a.xyz: b = (octaves, lacunarity, diminish), at most 32 octaves;
        /// `immediate`: 0 one number in all components, 1 a vector in xyz and the number at a.xyz + (19, 193, 17) in w,
        /// 2 the number and the one of w as a vector of two (`MaterialX`'s vector2), zw = 0.
        Fractal3,
        /// The same in 2D, of a.xy; the offset is (19, 193).
        Fractal2,
        /// A value of the surface: `immediate` is a [`PatternGeometry`].
        Surface,
        /// The texel of a lookup of the program (`oocpt_materialx::program::ProgramLookup`), whose number is the low
        /// byte of `immediate`: at a.xy, or with bit 8 at the coordinates that the lookup's own map gives.
        Texture,
    }
}

numbered! {
    /// A value that [`PatternOp::Surface`] gives. Vectors are in world space unless said otherwise.
    PatternGeometry, "GEOMETRY" {
        /// The first set of texture coordinates of the material, (u, v, 0, 0).
        Uv0,
        /// Second set of texture coordinates.
        Uv1,
        /// The first primvar of the material, or its fallback.
        Primvar0,
        /// Second primvar of the material, or its fallback.
        Primvar1,
        /// The point, relative to the origin of the world.
        Position,
        /// The shading normal, unit.
        Normal,
        /// Tangent: unit, in the direction in which u grows.
        Tangent,
        /// Bitangent: unit, in the direction in which v grows.
        Bitangent,
        /// Unit vector from the viewer to the surface (as in `MaterialX`).
        ViewDirection,
        /// A random number of the hit, uniform in [0, 1), in all components: it chooses between slabs that are mixed.
        /// Not available in programs for opacity or emission.
        Random0,
        /// A random number that is independent of the first.
        Random1,
        /// A random number that is independent of the first two.
        Random2,
        /// Unit vector in world space, perpendicular to the normal: the tangent of the frame of
        /// [`crate::MaterialInput::Normal`]. [`Self::Tangent`] if the mesh has one, else any.
        FrameX,
        /// Bitangent of that frame.
        FrameY,
    }
}

impl PatternGeometry {
    /// The random numbers of a hit.
    pub const RANDOM: [Self; 3] = [Self::Random0, Self::Random1, Self::Random2];
}

numbered! {
    /// Inputs of the BSDF, by their indices in `GpuMaterial::inputs`.
    ///
    /// For a fibre (`chiang_hair_bsdf`) some have another meaning: `DiffuseColor`, `SpecularColor`, `TransmissionColor`
    /// are the tints of R, TT and TRT; `Anisotropy` is variance along the fibre and scale of the logistic across it, of
    /// R, then of TT; `ThinFilm` is the same of TRT, and the tilt of the cuticle in radians; `Absorption` is per radius
    /// of the fibre; `Normal` is the position of the hit across the width of a ribbon.
    MaterialInput, "INPUT" {
        /// Diffuse reflectance, and reflectance of the metallic part.
        DiffuseColor,
        /// Emitted radiance.
        EmissiveColor,
        /// Reflectance at normal incidence, in the specular workflow.
        SpecularColor,
        /// Share of metal.
        Metallic,
        /// Roughness of the base.
        Roughness,
        /// Share of the coat.
        Clearcoat,
        /// Roughness of the coat.
        ClearcoatRoughness,
        /// Opacity of the surface.
        Opacity,
        /// Index of refraction of the base.
        Ior,
        /// Normal in the frame of the surface.
        Normal,
        /// Share of the part that is not metal that is glass.
        Transmission,
        /// Colour that multiplies refracted light.
        TransmissionColor,
        /// Index of refraction of the coat.
        CoatIor,
        /// Colour of the fuzz, times its weight.
        SheenColor,
        /// Roughness of the fuzz.
        SheenRoughness,
        /// Ratio of the alphas across and along the tangent, and rotation of the tangent toward the bitangent (1: a
        /// whole turn); of the base, then of the coat.
        Anisotropy,
        /// Weight, thickness in nm, index of refraction of a film on the base.
        ThinFilm,
        /// Absorption of light inside, per unit of length; for dispersive materials 1 / the Abbe number in the last
        /// component.
        Absorption,
        /// Roughness of the diffuse lobe.
        DiffuseRoughness,
    }
}

impl MaterialInput {
    /// Number of components that are used.
    #[must_use]
    pub const fn width(self) -> usize {
        match self {
            Self::DiffuseColor
            | Self::EmissiveColor
            | Self::SpecularColor
            | Self::Normal
            | Self::TransmissionColor
            | Self::SheenColor
            | Self::ThinFilm
            | Self::Absorption => 3,
            Self::Anisotropy => 4,
            _ => 1,
        }
    }
}
