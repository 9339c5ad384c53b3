// SPDX-License-Identifier: Apache-2.0
//! Pattern programs and inputs of materials: their operations, what a surface gives them, and what they work out. Each
//! has a number, its place in its list. Any thread.

/// Lookups of a program for opacity, at most: with streaming the values of all but one are kept with a ray's question.
pub const CUTOUT_LOOKUPS: u32 = 4;
/// Registers of a program, f32x4 each; operands from here on are its constants.
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
            /// How many there are.
            pub const COUNT: usize = [$(stringify!($variant)),+].len();
            /// All of them, by their numbers.
            pub const ALL: [Self; Self::COUNT] = [$(Self::$variant),+];

            /// Names and numbers for the shaders.
            pub(crate) fn constants() -> impl Iterator<Item = (String, u32)> {
                Self::ALL.into_iter().map(|one| (upper_case($prefix, &format!("{one:?}")), u32::from(one as u8)))
            }
        }
    };
}

/// `RgbToHsv` is `RGB_TO_HSV`.
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
    /// What an instruction of a pattern program does. `a`, `b`, `c` are its operands; by component unless said
    /// otherwise. What is undefined in `MaterialX` (a division by 0, a root of a negative number) gives 0 here. Results
    /// that are no finite numbers are 0, and so are those below 2^-126; there is no -0.
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
        /// -1, 0 or 1.
        Sign,
        /// The integer not above a.
        Floor,
        /// The integer not below a.
        Ceil,
        /// floor(a + 0.5), without rounding in between.
        Round,
        /// a - floor(a).
        Fract,
        /// a to the power of b; 1 where b, else 0 where a = 0. Of a negative a only with a whole b.
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
        /// The lesser.
        Min,
        /// The greater.
        Max,
        /// a (1 - c) + b c.
        Mix,
        /// a limited to b..c.
        Clamp,
        /// Hermite step of a from b to c; 1 where a >= c, else 0 where a <= b.
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
        /// Component k is the one of a that bits 3k to 3k + 2 of `immediate` say: 0 to 3, 4 = the number 0, 5 = the
        /// number 1.
        Swizzle,
        /// Component k is that of b where bit k of `immediate` is set, else that of a.
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
        /// The same in 3D, of a.xyz.
        Worley3,
        /// Fractal sum of Perlin noise (3D) of a.xyz: b = (octaves, lacunarity, diminish), at most 32 octaves;
        /// `immediate`: 0 one number in all components, 1 a vector in xyz and the number at a.xyz + (19, 193, 17) in w,
        /// 2 the number and the one of w as a vector of two (`MaterialX`'s vector2), zw = 0.
        Fractal3,
        /// The same in 2D, of a.xy; the offset is (19, 193).
        Fractal2,
        /// What the surface has: `immediate` is a [`PatternGeometry`].
        Surface,
        /// The texel of a lookup of the program (`oocpt_materialx::program::ProgramLookup`), whose number is the low
        /// byte of `immediate`: at a.xy, or with bit 8 at the place that the lookup's own map says.
        Texture,
    }
}

numbered! {
    /// What [`PatternOp::Surface`] gives. Vectors in the world unless said otherwise.
    PatternGeometry, "GEOMETRY" {
        /// The first set of texture coordinates of the material, (u, v, 0, 0).
        Uv0,
        /// The second.
        Uv1,
        /// The first primvar of the material, or its fallback.
        Primvar0,
        /// The second.
        Primvar1,
        /// The point, relative to the origin of the world.
        Position,
        /// The shading normal, unit.
        Normal,
        /// Unit, where u grows.
        Tangent,
        /// Unit, where v grows.
        Bitangent,
        /// Unit, from the viewer to the surface (as `MaterialX` has it).
        ViewDirection,
        /// A random number of the hit, uniform in [0, 1), in all components: it chooses between slabs that are mixed.
        /// Not in programs for opacity or emission.
        Random0,
        /// Another one, independent of the first.
        Random1,
        /// A third one.
        Random2,
        /// Unit, world, at right angles to the normal: the tangent of the frame that [`crate::MaterialInput::Normal`]
        /// is told in. [`Self::Tangent`] where the mesh has one, else any.
        FrameX,
        /// Its bitangent.
        FrameY,
    }
}

impl PatternGeometry {
    /// The random numbers of a hit.
    pub const RANDOM: [Self; 3] = [Self::Random0, Self::Random1, Self::Random2];
}

numbered! {
    /// Inputs of the one BSDF, by their places in `GpuMaterial::inputs`.
    ///
    /// Of a fibre (`chiang_hair_bsdf`) some mean something else: `DiffuseColor`, `SpecularColor`, `TransmissionColor`
    /// are the tints of R, TT and TRT; `Anisotropy` is variance along the fibre and scale of the logistic across it, of
    /// R, then of TT; `ThinFilm` the same of TRT, and the tilt of the cuticle in radians; `Absorption` is by the
    /// fibre's radius; `Normal` is where a ribbon is met across its width.
    MaterialInput, "INPUT" {
        /// Diffuse reflectance, and reflectance of the metallic part.
        DiffuseColor,
        /// Radiance.
        EmissiveColor,
        /// Reflectance at normal incidence, in the specular workflow.
        SpecularColor,
        /// Share of metal.
        Metallic,
        /// Of the base.
        Roughness,
        /// Share of the coat.
        Clearcoat,
        /// Of the coat.
        ClearcoatRoughness,
        /// Whether the surface is there.
        Opacity,
        /// Of the base.
        Ior,
        /// In the frame of the surface.
        Normal,
        /// Share of what is not metal that is glass.
        Transmission,
        /// What a refraction is multiplied by.
        TransmissionColor,
        /// Of the coat.
        CoatIor,
        /// Colour of the fuzz, times its weight.
        SheenColor,
        /// Of the fuzz.
        SheenRoughness,
        /// Ratio of the alphas across and along the tangent, turn of the tangent toward the bitangent (1: a whole one);
        /// of the base, then of the coat.
        Anisotropy,
        /// Weight, thickness in nm, index of a film on the base.
        ThinFilm,
        /// Of light inside, per unit of length; of what is dispersive 1 / its Abbe number in the last component.
        Absorption,
        /// Of the diffuse lobe.
        DiffuseRoughness,
    }
}

impl MaterialInput {
    /// Components that count.
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
