// SPDX-License-Identifier: Apache-2.0
//! Solids of revolution, as they cross the boundary. Pure; any thread.
//!
//! Numbers: the axis (0 x, 1 y, 2 z), whether half balls end it (0 or 1), then four for each size: part of the shutter,
//! radii at the lower and the upper end, height. The first size is the frame's own.

use crate::convert::ConversionWarnings;
use crate::ffi;
use oocpt_core::scene::{SolidDesc, SolidSize};

/// [`ffi::ShapeDesc::kind`] of a solid of revolution.
const SOLID: u8 = 3;

impl ConversionWarnings {
    /// The solid that a prim is, if it is one.
    pub(super) fn solid(&mut self, path: &str, desc: &ffi::ShapeDesc) -> Option<SolidDesc> {
        if desc.kind != SOLID {
            return None;
        }
        let (&[axis, is_round], sizes) = desc.solid.split_first_chunk()?;
        let (sizes, _) = sizes.as_chunks::<4>();
        let size = |&[time, lower, upper, height]: &[f64; 4]| (time, SolidSize { radii: [lower, upper], height });
        let mut sizes = sizes.iter().map(size);
        let (_, size) = sizes.next()?;
        let axis = [0.0, 1.0].into_iter().position(|number| axis <= number).unwrap_or(2);
        let solid = SolidDesc { size, samples: sizes.collect(), axis, is_round: is_round > 0.0 };
        if !solid.is_usable() {
            self.add(path, "size", "its radius or height is not a finite number; left out");
        }
        Some(solid)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convert::mesh;
    use crate::convert::tests::{mesh_desc, no_shape};

    #[test]
    fn a_solid_arrives_with_its_sizes() {
        let numbers = vec![1.0, 1.0, 9.0, 1.0, 2.0, 3.0, 0.0, 4.0, 5.0, 6.0, 1.0, 7.0, 8.0, f64::NAN, 11.0];
        let shape = |solid| ffi::ShapeDesc { kind: 3, solid, ..no_shape() };
        let mut complaints = ConversionWarnings::default();
        let converted = mesh(ffi::MeshDesc { shape: shape(numbers), ..mesh_desc() }, &mut complaints);
        let solid = converted.solid.expect("a solid");
        assert_eq!((solid.size, solid.axis), (SolidSize { radii: [1.0, 2.0], height: 3.0 }, 1), "the frame's own");
        assert_eq!(solid.samples[0], (0.0, SolidSize { radii: [4.0, 5.0], height: 6.0 }), "a sample");
        assert!(solid.samples.len() == 2 && solid.is_round, "what is left over is nothing");
        assert_eq!(complaints.0.len(), 1, "a height that is no number is told: {:?}", complaints.0);
        let nothing = mesh(ffi::MeshDesc { shape: shape(Vec::new()), ..mesh_desc() }, &mut complaints);
        assert!(nothing.solid.is_none(), "without a size it is none");
    }
}
