// SPDX-License-Identifier: Apache-2.0
//! Reads authored inputs of nodes as numbers. Pure. A value of the wrong type is a problem, reported once for the
//! material.

use crate::desc::{AssetRef, ConnectionDesc, NodeDesc, ParamValue};

/// Problems of a material, each kind once.
#[derive(Debug, Default)]
pub(super) struct ProblemList(Vec<String>);

impl ProblemList {
    /// Largest number of problems that are reported for one material.
    const MAX_PROBLEMS: usize = 8;
    /// Most bytes of a problem's text.
    const MAX_PROBLEM_BYTES: usize = 512;

    /// Adds a problem. It may contain long texts of the scene: it is cut to [`Self::MAX_PROBLEM_BYTES`].
    pub(super) fn add(&mut self, mut problem: String) {
        if problem.len() > Self::MAX_PROBLEM_BYTES {
            problem.truncate(problem.floor_char_boundary(Self::MAX_PROBLEM_BYTES));
            problem.push_str("...");
        }
        if self.0.len() < Self::MAX_PROBLEMS && !self.0.contains(&problem) {
            self.0.push(problem);
        }
    }

    pub(super) fn lines(self) -> Vec<String> {
        self.0
    }
}

/// The kind of number that an input takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NumberShape {
    /// One number, which is stored in all components.
    Scalar,
    /// Two numbers.
    Pair,
    /// Three numbers.
    Color,
    /// Four numbers.
    Four,
}

pub(super) fn param<'a>(node: &'a NodeDesc, name: &str) -> Option<&'a ParamValue> {
    node.params.iter().find(|param| &*param.name == name).map(|param| &param.value)
}

pub(super) fn connection<'a>(node: &'a NodeDesc, name: &str) -> Option<&'a ConnectionDesc> {
    node.connections.iter().find(|connection| &*connection.input == name)
}

/// The text of an input, if it is authored and is text.
pub(super) fn text<'a>(node: &'a NodeDesc, name: &str, problems: &mut ProblemList) -> Option<&'a str> {
    match param(node, name)? {
        ParamValue::Text(text) => Some(text),
        _ => {
            problems.add(format!("`{name}` of {} is no text", node.path));
            None
        }
    }
}

/// The file of an input; text counts as a path that was not resolved.
pub(super) fn asset(node: &NodeDesc, name: &str, problems: &mut ProblemList) -> Option<AssetRef> {
    match param(node, name)? {
        ParamValue::Asset(asset) => Some(asset.clone()),
        ParamValue::Text(text) => Some(AssetRef { authored: text.clone(), resolved: text.clone() }),
        _ => {
            problems.add(format!("`{name}` of {} is no file", node.path));
            None
        }
    }
}

/// The number or numbers of an input, or `default`. A number in place of a bool or of an integer is accepted, and vice
/// versa; so are four in place of three.
pub(super) fn numbers(
    node: &NodeDesc,
    name: &str,
    shape: NumberShape,
    default: [f32; 4],
    problems: &mut ProblemList,
) -> [f32; 4] {
    let Some(value) = param(node, name) else { return default };
    match shaped(value, shape) {
        Some(numbers) if numbers.iter().all(|v| v.is_finite()) => numbers,
        Some(_) => {
            problems.add(format!("`{name}` of {} is not finite", node.path));
            default
        }
        None => {
            problems.add(format!("`{name}` of {} has the wrong type", node.path));
            default
        }
    }
}

#[expect(clippy::cast_precision_loss, reason = "integers of inputs are small, and a rounded large one is as good")]
fn shaped(value: &ParamValue, shape: NumberShape) -> Option<[f32; 4]> {
    match (value, shape) {
        (ParamValue::Float(v), NumberShape::Scalar) => Some([*v; 4]),
        (ParamValue::Int(v), NumberShape::Scalar) => Some([*v as f32; 4]),
        (ParamValue::Bool(v), NumberShape::Scalar) => Some([f32::from(u8::from(*v)); 4]),
        (ParamValue::Vec2([x, y]), NumberShape::Pair) => Some([*x, *y, 0.0, 0.0]),
        (ParamValue::Vec3([x, y, z]) | ParamValue::Vec4([x, y, z, _]), NumberShape::Color) => Some([*x, *y, *z, 1.0]),
        (ParamValue::Vec4(v), NumberShape::Four) => Some(*v),
        _ => None,
    }
}
