// SPDX-License-Identifier: Apache-2.0
//! Types and values of `MaterialX` ports.

use std::sync::Arc;

/// Type of a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PortType {
    /// `float`, `integer` and `boolean`: one number, in all components.
    Float,
    /// `vector2`.
    Vector2,
    /// `vector3`.
    Vector3,
    /// `vector4`.
    Vector4,
    /// `color3`.
    Color3,
    /// `color4`.
    Color4,
    /// `string`.
    Text,
    /// `filename`.
    File,
    /// `matrix33`.
    Matrix3,
    /// `matrix44`.
    Matrix4,
    /// Anything else: closures, arrays.
    Other,
}

impl PortType {
    /// The type of a name.
    #[must_use]
    pub fn named(name: &str) -> Self {
        match name {
            "float" | "integer" | "boolean" => Self::Float,
            "vector2" => Self::Vector2,
            "vector3" => Self::Vector3,
            "vector4" => Self::Vector4,
            "color3" => Self::Color3,
            "color4" => Self::Color4,
            "string" => Self::Text,
            "filename" => Self::File,
            "matrix33" => Self::Matrix3,
            "matrix44" => Self::Matrix4,
            _ => Self::Other,
        }
    }

    /// Components that count; 0 where it is no number.
    #[must_use]
    pub fn width(self) -> u16 {
        match self {
            Self::Float => 1,
            Self::Vector2 => 2,
            Self::Vector3 | Self::Color3 => 3,
            Self::Vector4 | Self::Color4 => 4,
            Self::Text | Self::File | Self::Matrix3 | Self::Matrix4 | Self::Other => 0,
        }
    }
}

/// A file that a node names.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct FileRef {
    /// As the scene has it.
    pub authored: Arc<str>,
    /// What it resolves to; empty where nothing was found.
    pub resolved: Arc<str>,
    /// The colour space that the input says, if it does.
    pub color_space: Option<Arc<str>>,
    /// The node that names it.
    pub node: Arc<str>,
}

/// The value of an input.
#[derive(Clone, Debug, PartialEq)]
pub enum PortValue {
    /// Numbers: one in all components; what is missing is 0.
    Numbers([f32; 4]),
    /// Text.
    Text(Arc<str>),
    /// A file.
    File(FileRef),
    /// Rows of a matrix, which vectors are multiplied by from the left; what is missing is 0.
    Matrix([[f32; 4]; 4]),
}

impl PortValue {
    /// Reads a value as library files write it; `None` where it is none of that type.
    #[must_use]
    pub fn parse(ty: PortType, text: &str) -> Option<Self> {
        match ty {
            PortType::Text => return Some(Self::Text(text.into())),
            PortType::Float if text == "true" => return Some(Self::Numbers([1.0; 4])),
            PortType::Float if text == "false" => return Some(Self::Numbers([0.0; 4])),
            PortType::Matrix3 => return matrix(text, 3),
            PortType::Matrix4 => return matrix(text, 4),
            PortType::File | PortType::Other => return None,
            _ => {}
        }
        let mut numbers = [0.0; 4];
        let mut count = 0;
        for part in text.split(',') {
            let number = part.trim().parse::<f32>().ok().filter(|number| number.is_finite())?;
            *numbers.get_mut(count)? = number;
            count += 1;
        }
        match (count, usize::from(ty.width())) {
            (1, _) => Some(Self::Numbers([numbers[0]; 4])),
            (count, width) if count == width => Some(Self::Numbers(numbers)),
            _ => None,
        }
    }
}

/// Reads a matrix of `width` rows.
fn matrix(text: &str, width: usize) -> Option<PortValue> {
    let mut rows = [[0.0; 4]; 4];
    let mut count = 0;
    for part in text.split(',') {
        let number = part.trim().parse::<f32>().ok().filter(|number| number.is_finite())?;
        *rows.get_mut(count / width)?.get_mut(count % width)? = number;
        count += 1;
    }
    (count == width * width).then_some(PortValue::Matrix(rows))
}
