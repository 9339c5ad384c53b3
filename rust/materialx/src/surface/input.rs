// SPDX-License-Identifier: Apache-2.0
//! The inputs of the renderer's BSDF, to which surfaces are reduced.

pub use oocpt_abi::MaterialInput as Input;

/// Default values by [`Input`].
pub(crate) const DEFAULTS: [[f32; 4]; Input::COUNT] = [
    [0.8, 0.8, 0.8, 1.0],
    [0.0, 0.0, 0.0, 1.0],
    [0.0, 0.0, 0.0, 1.0],
    [0.0; 4],
    [0.3; 4],
    [0.0; 4],
    [0.0; 4],
    [1.0; 4],
    [1.5; 4],
    [0.0, 0.0, 1.0, 1.0],
    [0.0; 4],
    [1.0; 4],
    [1.5; 4],
    [0.0, 0.0, 0.0, 1.0],
    [0.3; 4],
    [1.0, 0.0, 1.0, 0.0],
    [0.0, 0.0, 1.4, 0.0],
    [0.0; 4],
    [0.0; 4],
];
