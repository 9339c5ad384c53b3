// SPDX-License-Identifier: Apache-2.0
//! Pattern programs: numbers of operations and of what a surface has, by their names in the shaders.
//!
//! They are those of `oocpt_materialx::program::{Op, Geometry}`, which this crate may not use; a test of `oocpt-render`
//! compares them. Any thread.

/// Names, numbered in their order.
macro_rules! numbered {
    ($prefix:literal: $($name:ident)+) => {{
        let names = &[$(concat!($prefix, stringify!($name))),+];
        let mut table = [("", 0); [$(stringify!($name)),+].len()];
        let (mut at, mut number) = (0, 0);
        while at < table.len() {
            table[at] = (names[at], number);
            (at, number) = (at + 1, number + 1);
        }
        table
    }};
}

/// Name and number of every operation. The build writes a `const uint` of each.
pub const PATTERN_OPS: [(&str, u32); 52] = numbered! { "PATTERN_":
    MOVE ADD SUBTRACT MULTIPLY DIVIDE MODULO ABSOLUTE SIGN FLOOR CEIL ROUND FRACT POWER SQRT LN EXP SIN COS TAN ASIN
    ACOS ATAN2 MIN MAX MIX CLAMP SMOOTHSTEP MULTIPLY_ADD DOT CROSS NORMALIZE LENGTH GREATER GREATER_EQUAL EQUAL SELECT
    SWIZZLE BLEND RGB_TO_HSV HSV_TO_RGB NOISE2 NOISE2_VECTOR NOISE3 NOISE3_VECTOR CELL_NOISE2 CELL_NOISE3 WORLEY2
    WORLEY3 FRACTAL3 FRACTAL2 SURFACE TEXTURE
};

/// Name and number of everything that `PATTERN_SURFACE` gives. The build writes a `const uint` of each.
pub const PATTERN_GEOMETRY: [(&str, u32); 14] = numbered! { "GEOMETRY_":
    UV0 UV1 PRIMVAR0 PRIMVAR1 POSITION NORMAL TANGENT BITANGENT VIEW_DIRECTION RANDOM0 RANDOM1 RANDOM2 FRAME_X
    FRAME_Y
};
