// SPDX-License-Identifier: Apache-2.0
//! The table of shapes of lights. From it the build writes the code that dispatches on all shapes
//! (`generated/light_shapes.glsl`).
//!
//! A row is the only declaration of a shape in the tables; its code is `shaders/light/shapes/NAME.glsl`, and
//! `shaders/light/shape.glsl` lists the functions that it has. `oocpt_core::scene::LocalShape` has the same names.
//! Pure, any thread.

/// A row of [`LIGHT_SHAPES`].
#[derive(Debug, Clone, Copy)]
pub struct LightShape {
    /// Name of its file and its functions.
    pub name: &'static str,
    /// The low four bits of a light's `flags`; those of lights at infinity are [`super::GpuLightKind`].
    pub kind: u32,
    /// True if no ray can meet it.
    pub is_thin: bool,
}

/// Rows of all shapes.
pub const LIGHT_SHAPES: &[LightShape] = &[
    LightShape { name: "rect", kind: 0, is_thin: false },
    LightShape { name: "disk", kind: 1, is_thin: false },
    LightShape { name: "sphere", kind: 2, is_thin: false },
    LightShape { name: "cylinder", kind: 3, is_thin: false },
    LightShape { name: "point", kind: 4, is_thin: true },
    LightShape { name: "line", kind: 5, is_thin: true },
    #[cfg(feature = "faults")]
    LightShape { name: "toy_light", kind: 9, is_thin: false },
];
