// SPDX-License-Identifier: Apache-2.0
//! Programs: what patterns of a material are compiled to. The twin that runs them on the device is
//! `shaders/include/pattern.glsl`.
//!
//! A program is a list of instructions without branches over [`REGISTERS`] registers of four f32 each. Integers and
//! booleans are floats (0 and 1). An operand is a register or a constant of the program.

/// Registers of a program.
pub const REGISTERS: usize = 32;
/// Constants of a program, at most: an operand is a byte.
pub const MAX_CONSTANTS: usize = 256 - REGISTERS;
/// Instructions of a program, at most.
pub const MAX_INSTRUCTIONS: usize = 1024;
/// Texture lookups of a program, at most: what is kept of lookups under way has this many places.
pub const MAX_LOOKUPS: usize = 12;
/// Texture lookups of a program for opacity, at most.
pub const MAX_OPACITY_LOOKUPS: usize = 4;

/// What an instruction does. `a`, `b`, `c` are its operands; by component unless said otherwise. What is undefined in
/// `MaterialX` (a division by 0, a root of a negative number) gives 0 here. Results that are no finite numbers are 0,
/// and so are those below 2^-126; there is no -0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u8)]
pub enum Op {
    /// a.
    Move = 0,
    /// a + b.
    Add = 1,
    /// a - b.
    Subtract = 2,
    /// a b.
    Multiply = 3,
    /// a / b.
    Divide = 4,
    /// a - b floor(a / b).
    Modulo = 5,
    /// |a|.
    Absolute = 6,
    /// -1, 0 or 1.
    Sign = 7,
    /// The integer not above a.
    Floor = 8,
    /// The integer not below a.
    Ceil = 9,
    /// floor(a + 0.5), without rounding in between.
    Round = 10,
    /// a - floor(a).
    Fract = 11,
    /// a to the power of b; 1 where b = 0, else 0 where a = 0. Of a negative a only with a whole b.
    Power = 12,
    /// Square root.
    Sqrt = 13,
    /// Natural logarithm.
    Ln = 14,
    /// e^a.
    Exp = 15,
    /// Sine of an angle in radians.
    Sin = 16,
    /// Cosine of an angle in radians.
    Cos = 17,
    /// Tangent of an angle in radians.
    Tan = 18,
    /// Arc sine of a, clamped to -1..1.
    Asin = 19,
    /// Arc cosine of a, clamped to -1..1.
    Acos = 20,
    /// Angle of the vector (b, a).
    Atan2 = 21,
    /// The lesser.
    Min = 22,
    /// The greater.
    Max = 23,
    /// a (1 - c) + b c.
    Mix = 24,
    /// a limited to b..c.
    Clamp = 25,
    /// Hermite step of a from b to c; 1 where a >= c, else 0 where a <= b.
    Smoothstep = 26,
    /// a b + c.
    MultiplyAdd = 27,
    /// Sum of the products of the first `immediate` components, in all components.
    Dot = 28,
    /// Cross product of the first three components; w = 0.
    Cross = 29,
    /// a over its length, of the first `immediate` components; the others are 0. 0 stays 0.
    Normalize = 30,
    /// Length of the first `immediate` components, in all components.
    Length = 31,
    /// 1 where a > b, else 0.
    Greater = 32,
    /// 1 where a >= b, else 0.
    GreaterEqual = 33,
    /// 1 where a = b, else 0.
    Equal = 34,
    /// a where c is not 0, else b.
    Select = 35,
    /// Component k is the one of a that bits 3k to 3k + 2 of `immediate` say: 0 to 3, 4 = the number 0, 5 = the
    /// number 1.
    Swizzle = 36,
    /// Component k is that of b where bit k of `immediate` is set, else that of a.
    Blend = 37,
    /// Hue, saturation, value of a colour, alpha as it is.
    RgbToHsv = 38,
    /// The colour of hue, saturation, value, alpha as it is.
    HsvToRgb = 39,
    /// `MaterialX`'s `mx_perlin_noise_float` (2D) of a.xy in all components.
    Noise2 = 40,
    /// `mx_perlin_noise_vec3` (2D) of a.xy in xyz; w: noise of a.xy + (19, 73).
    Noise2Vector = 41,
    /// `mx_perlin_noise_float` (3D) of a.xyz in all components.
    Noise3 = 42,
    /// `mx_perlin_noise_vec3` (3D) of a.xyz in xyz; w: noise of a.xyz + (19, 73, 29).
    Noise3Vector = 43,
    /// `mx_cell_noise_float` of a.xy in all components.
    CellNoise2 = 44,
    /// `mx_cell_noise_float` of a.xyz in all components.
    CellNoise3 = 45,
    /// Worley noise (2D) of a.xy with jitter b.x; `immediate`: 0 F1 in all components, 1 (F1, F2, 0, 0), 2 (F1, F2,
    /// F3, 0), 3 cell noise of the nearest point in all components (`MaterialX`'s style 1), 4 the same as a vector
    /// (`mx_cell_noise_vec3`; w = 0).
    Worley2 = 46,
    /// The same in 3D, of a.xyz.
    Worley3 = 47,
    /// Fractal sum of Perlin noise (3D) of a.xyz: b = (octaves, lacunarity, diminish), at most 32 octaves;
    /// `immediate`: 0 one number in all components, 1 a vector in xyz and the number at a.xyz + (19, 193, 17) in w, 2
    /// the number and the one of w as a vector of two (`MaterialX`'s vector2), zw = 0.
    Fractal3 = 48,
    /// The same in 2D, of a.xy; the offset is (19, 193).
    Fractal2 = 49,
    /// What the surface has: `immediate` is a [`Geometry`].
    Surface = 50,
    /// The texel of a lookup of the program ([`Lookup`]), whose number is the low byte of `immediate`: at a.xy, or with
    /// bit 8 at the place that the lookup's own map says.
    Texture = 51,
}

impl Op {
    /// Every operation, in the order of their numbers.
    pub const ALL: [Self; 52] = [
        Self::Move,
        Self::Add,
        Self::Subtract,
        Self::Multiply,
        Self::Divide,
        Self::Modulo,
        Self::Absolute,
        Self::Sign,
        Self::Floor,
        Self::Ceil,
        Self::Round,
        Self::Fract,
        Self::Power,
        Self::Sqrt,
        Self::Ln,
        Self::Exp,
        Self::Sin,
        Self::Cos,
        Self::Tan,
        Self::Asin,
        Self::Acos,
        Self::Atan2,
        Self::Min,
        Self::Max,
        Self::Mix,
        Self::Clamp,
        Self::Smoothstep,
        Self::MultiplyAdd,
        Self::Dot,
        Self::Cross,
        Self::Normalize,
        Self::Length,
        Self::Greater,
        Self::GreaterEqual,
        Self::Equal,
        Self::Select,
        Self::Swizzle,
        Self::Blend,
        Self::RgbToHsv,
        Self::HsvToRgb,
        Self::Noise2,
        Self::Noise2Vector,
        Self::Noise3,
        Self::Noise3Vector,
        Self::CellNoise2,
        Self::CellNoise3,
        Self::Worley2,
        Self::Worley3,
        Self::Fractal3,
        Self::Fractal2,
        Self::Surface,
        Self::Texture,
    ];
}

/// What [`Op::Surface`] gives. Vectors in the world unless said otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u16)]
pub enum Geometry {
    /// The first set of texture coordinates of the material, (u, v, 0, 0).
    Uv0 = 0,
    /// The second.
    Uv1 = 1,
    /// The first primvar of the material, or its fallback.
    Primvar0 = 2,
    /// The second.
    Primvar1 = 3,
    /// The point, relative to the origin of the world.
    Position = 4,
    /// The shading normal, unit.
    Normal = 5,
    /// Unit, where u grows.
    Tangent = 6,
    /// Unit, where v grows.
    Bitangent = 7,
    /// Unit, from the viewer to the surface (as `MaterialX` has it).
    ViewDirection = 8,
    /// A random number of the hit, uniform in [0, 1), in all components: it chooses between slabs that are mixed. Not
    /// in programs for opacity or emission.
    Random0 = 9,
    /// Another one, independent of the first.
    Random1 = 10,
    /// A third one.
    Random2 = 11,
    /// Unit, world, at right angles to the normal: the tangent of the frame that [`crate::surface::Input::Normal`] is
    /// told in. [`Geometry::Tangent`] where the mesh has one, else any.
    FrameX = 12,
    /// Its bitangent.
    FrameY = 13,
}

impl Geometry {
    /// The random numbers of a hit.
    pub const RANDOM: [Self; 3] = [Self::Random0, Self::Random1, Self::Random2];
}

/// A texture lookup of a program.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lookup {
    /// Number of the texture.
    pub texture: u32,
    /// Set of texture coordinates whose footprint the filter has; `None`: no filter.
    pub uv: Option<u8>,
    /// Rows of the affine map from that set to the place that is looked at, as far as it is one: for the filter only.
    pub transform: [[f32; 3]; 2],
    /// What multiplies a texel that was found, and what is added.
    pub scale: [f32; 4],
    /// See `scale`.
    pub bias: [f32; 4],
}

/// Where an instruction finds a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Operand {
    /// A register, below [`REGISTERS`].
    Register(u8),
    /// A constant, below [`MAX_CONSTANTS`].
    Constant(u8),
}

/// An instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Instruction {
    /// What it does.
    pub op: Op,
    /// The register that it writes.
    pub to: u8,
    /// a, b, c.
    pub operands: [Operand; 3],
    /// See [`Op`].
    pub immediate: u16,
}

impl Operand {
    /// The byte of the packed form: registers first, then constants.
    #[expect(clippy::cast_possible_truncation, reason = "few registers")]
    fn byte(self) -> u32 {
        match self {
            Self::Register(at) => u32::from(at),
            Self::Constant(at) => REGISTERS as u32 + u32::from(at),
        }
    }
}

impl Instruction {
    /// The packed form that the device reads: op | to << 8 | a << 16 | b << 24, c | immediate << 8.
    #[must_use]
    pub fn pack(&self) -> [u32; 2] {
        let [a, b, c] = self.operands.map(Operand::byte);
        [self.op as u32 | u32::from(self.to) << 8 | a << 16 | b << 24, c | u32::from(self.immediate) << 8]
    }
}

/// A program.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Program {
    /// In order; at most [`MAX_INSTRUCTIONS`].
    pub instructions: Vec<Instruction>,
    /// At most [`MAX_CONSTANTS`].
    pub constants: Vec<[f32; 4]>,
    /// At most [`MAX_LOOKUPS`].
    pub lookups: Vec<Lookup>,
}

impl Program {
    /// Whether it reads a random number of the hit.
    #[must_use]
    pub fn is_random(&self) -> bool {
        Geometry::RANDOM.into_iter().any(|random| self.reads(random))
    }

    /// Whether it reads this of the surface.
    #[must_use]
    pub fn reads(&self, geometry: Geometry) -> bool {
        self.instructions.iter().any(|step| step.op == Op::Surface && step.immediate == geometry as u16)
    }
}
