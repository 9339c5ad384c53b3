// SPDX-License-Identifier: Apache-2.0
//! Surface attributes in the order in which the GPU reads them.

use oocpt_abi::AttributeRate;

/// A primvar that a bound material asks for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WantedPrimvar {
    /// Name without `primvars:`.
    pub name: std::sync::Arc<str>,
    /// Number of the name.
    pub id: u32,
}

/// A primvar of a mesh that a material reads.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshPrimvar {
    /// Number of its name; materials use the same numbers.
    pub id: u32,
    /// Values and their rate.
    pub values: AnyAttribute,
}

/// An attribute of one to four floats.
#[derive(Clone, Debug, PartialEq)]
pub enum AnyAttribute {
    /// One float per value.
    One(Attribute<f32>),
    /// Two floats per value.
    Two(Attribute<[f32; 2]>),
    /// Three floats per value.
    Three(Attribute<[f32; 3]>),
    /// Four floats per value.
    Four(Attribute<[f32; 4]>),
}

/// Runs an expression on the attribute inside.
macro_rules! each_width {
    ($any:expr, $attribute:ident => $value:expr) => {
        match $any {
            $crate::mesh::AnyAttribute::One($attribute) => $value,
            $crate::mesh::AnyAttribute::Two($attribute) => $value,
            $crate::mesh::AnyAttribute::Three($attribute) => $value,
            $crate::mesh::AnyAttribute::Four($attribute) => $value,
        }
    };
}
pub(crate) use each_width;

impl AnyAttribute {
    /// The rate, which tells how a value is found from a hit.
    #[must_use]
    pub fn rate(&self) -> AttributeRate {
        each_width!(self, attribute => attribute.rate)
    }

    /// Number of floats of a value.
    #[must_use]
    pub fn width(&self) -> u32 {
        match self {
            Self::One(_) => 1,
            Self::Two(_) => 2,
            Self::Three(_) => 3,
            Self::Four(_) => 4,
        }
    }

    /// All values as floats, [`Self::width`] each.
    #[must_use]
    pub fn floats(&self) -> &[f32] {
        each_width!(self, attribute => bytemuck::cast_slice(&attribute.values))
    }

    /// All values as bytes, to be written.
    pub(super) fn bytes_mut(&mut self) -> &mut [u8] {
        each_width!(self, attribute => bytemuck::cast_slice_mut(&mut attribute.values))
    }
}

/// Values and their rate; the length always fits the rate.
#[derive(Clone, Debug, PartialEq)]
pub struct Attribute<T> {
    /// The rate, which tells how `values` is indexed.
    pub rate: AttributeRate,
    /// Values, in the order that `rate` tells.
    pub values: Vec<T>,
}
