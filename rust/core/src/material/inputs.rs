// SPDX-License-Identifier: Apache-2.0
//! Inputs of a surface: those that say nothing, and what can be told from all of them alone. Pure.

use super::InputValue;
use oocpt_abi::{MaterialFlags, MaterialInput};

/// Inputs that say nothing. What `UsdPreviewSurface` has no name for keeps them.
pub(crate) const NEUTRAL: [InputValue; MaterialInput::COUNT] = {
    let mut inputs = [const { InputValue::Constant([0.0, 0.0, 0.0, 1.0]) }; MaterialInput::COUNT];
    inputs[MaterialInput::Opacity as usize] = InputValue::Constant([1.0; 4]);
    inputs[MaterialInput::Ior as usize] = InputValue::Constant([1.5; 4]);
    inputs[MaterialInput::Normal as usize] = InputValue::Constant([0.0, 0.0, 1.0, 1.0]);
    inputs[MaterialInput::TransmissionColor as usize] = InputValue::Constant([1.0; 4]);
    inputs[MaterialInput::CoatIor as usize] = InputValue::Constant([1.5; 4]);
    inputs[MaterialInput::SheenRoughness as usize] = InputValue::Constant([0.5; 4]);
    inputs[MaterialInput::Anisotropy as usize] = InputValue::Constant([1.0, 0.0, 1.0, 0.0]);
    inputs
};

/// What can be told from the inputs alone.
pub(super) fn needs(inputs: &[InputValue; MaterialInput::COUNT]) -> MaterialFlags {
    let differs = |name: MaterialInput, from: [f32; 3]| match &inputs[name as usize] {
        InputValue::Constant([x, y, z, _]) => [*x, *y, *z] != from,
        _ => true,
    };
    let emits = match &inputs[MaterialInput::EmissiveColor as usize] {
        InputValue::Constant([r, g, b, _]) => *r > 0.0 || *g > 0.0 || *b > 0.0,
        _ => true,
    };
    let coated = match &inputs[MaterialInput::Clearcoat as usize] {
        InputValue::Constant([value, ..]) => *value > 0.0,
        _ => true,
    };
    let mut flags = MaterialFlags::empty();
    flags.set(MaterialFlags::EMISSIVE, emits);
    flags.set(MaterialFlags::COAT, coated);
    flags.set(MaterialFlags::NORMAL_MAP, differs(MaterialInput::Normal, [0.0, 0.0, 1.0]));
    flags.set(MaterialFlags::TEXTURED, inputs.iter().any(|input| matches!(input, InputValue::Texture { .. })));
    flags
}
