// SPDX-License-Identifier: Apache-2.0
//! The attributes of pictures: names and values. Pure.

use serde::Serialize;

/// The prefix of our attributes' names.
pub(super) const PREFIX: &str = "oocpt:";
/// An attribute's value.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum PictureAttribute {
    /// A text.
    Text(String),
    /// A number; counts are exact below 2^53.
    Number(f64),
}

impl std::fmt::Display for PictureAttribute {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Text(text) => f.write_str(text),
            Self::Number(number) => write!(f, "{number}"),
        }
    }
}

/// The attributes of a picture: names without `oocpt:`, and values.
pub type PictureAttributes = Vec<(String, PictureAttribute)>;
