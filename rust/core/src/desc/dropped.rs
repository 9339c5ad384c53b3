// SPDX-License-Identifier: Apache-2.0
//! Counters of the parts of a description that cannot be used.

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

macro_rules! dropped {
    ($($(#[$doc:meta])* $field:ident: $text:literal),* $(,)?) => {
        /// Counters of bad data, by kind. Totals over the visible scene.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
        #[serde(default)]
        pub struct DroppedData {
            $($(#[$doc])* pub $field: u64,)*
        }

        impl DroppedData {
            /// Nothing dropped.
            pub const NONE: Self = Self { $($field: 0),* };

            /// Adds the counters of `other`.
            pub fn add(&mut self, other: &Self) {
                $(self.$field = self.$field.saturating_add(other.$field);)*
            }

            /// Every counter with its text for users, in a fixed order.
            #[must_use]
            pub fn entries(&self) -> Vec<(&'static str, u64)> {
                vec![$(($text, self.$field)),*]
            }
        }
    };
}

dropped! {
    /// Meshes or instancers whose arrays have the wrong element type.
    wrong_array_types: "arrays of the wrong type",
    /// Meshes without a single usable face.
    empty_meshes: "meshes without a usable face",
    /// Curves, points, spheres and capsules of which no piece, ribbon or ball remains: no points, no width, normals
    /// without a length.
    empty_items: "curves, points or spheres with nothing to draw",
    /// Meshes above the size limit.
    oversized_meshes: "meshes above the size limit",
    /// Faces with a negative number of corners.
    negative_counts: "faces with a negative vertex count",
    /// Faces with fewer than three corners.
    small_faces: "faces with fewer than 3 vertices",
    /// Faces with more corners than the triangulation accepts.
    huge_faces: "faces with too many vertices",
    /// Faces whose corners run past the end of the index array.
    faces_past_end: "faces past the end of faceVertexIndices",
    /// Indices that belong to no face.
    surplus_indices: "faceVertexIndices that belong to no face",
    /// Faces with a point index out of range.
    point_indices: "faces with point indices out of range",
    /// Faces with a NaN, infinite or huge point.
    non_finite_points: "faces with non-finite points",
    /// Triangles without area.
    zero_area_triangles: "zero-area triangles",
    /// Hole indices that name no face.
    hole_indices: "hole indices out of range",
    /// Faces of subdivision meshes that have a point twice, but not consecutively.
    folded_faces: "faces with a point twice",
    /// Creases and corners with inconsistent indices, lengths or sharpnesses.
    creases: "creases or corners that name no edge or have no usable sharpness",
    /// Subdivision meshes and displaced ones that OpenSubdiv cannot refine.
    unrefined_meshes: "meshes that cannot be subdivided or displaced, seen as polygons",
    /// Subdivision meshes and curves with more triangles or pieces than a prim may have at the wanted rate.
    coarse_meshes: "meshes or curves that are cut more coarsely than asked, to stay below the limit of their size",
    /// Points of displaced surfaces that would move to a coordinate that is not finite or is huge; they stay where they
    /// are.
    displacements: "displacements that are not finite or too large",
    /// Curves with fewer points than a segment has, a negative number of them, or points that cannot be used.
    curves: "curves with too few or unusable points",
    /// Points that are not finite, or have no finite width.
    points: "points without a usable place or width",
    /// Primvars dropped: too short, wrong type or unusable interpolation.
    primvars: "primvars of the wrong length, type or interpolation",
    /// Primvars that are longer than needed (they are used).
    long_primvars: "primvars longer than needed",
    /// Primvar values that are not finite or whose index is out of range; they are replaced.
    primvar_values: "primvar values not finite or out of range",
    /// Prims with a singular or non-finite transform.
    prim_transforms: "singular or non-finite transforms",
    /// Instances with a singular or non-finite matrix.
    instance_transforms: "instances with singular or non-finite matrices",
    /// Instances that do not move: a map of their motion is singular, not finite or too far away.
    instance_motions: "instances that do not move, with singular or non-finite matrices on their way",
    /// Instance indices that name no instance.
    instance_indices: "instance indices out of range",
    /// Faces of subsets that the mesh does not have.
    subset_faces: "subset faces out of range",
    /// Mask entries missing.
    short_masks: "masks shorter than the instances",
    /// Instancers that contain themselves.
    instancer_cycles: "instancers that contain themselves",
    /// Instancers nested deeper than the limit.
    deep_instancers: "instancers nested too deeply",
    /// References to an instancer or prototype that does not exist.
    missing_instancers: "missing instancers or prototypes",
    /// Lights with unusable values.
    lights: "lights with unusable values",
    /// Lights inside prototypes with more placements than are multiplied out.
    instanced_lights: "lights inside prototypes with too many places, some of which are left out",
}

impl DroppedData {
    /// Sum of all counters.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.entries().iter().fold(0, |sum, (_, n)| sum.saturating_add(*n))
    }

    /// The counters above 0 with their texts, in the order of [`Self::message`]: first those of bad data, then those of
    /// limits of the renderer that good data reached.
    #[must_use]
    pub fn by_cause(&self) -> [Vec<(&'static str, u64)>; 2] {
        let limits = Self {
            oversized_meshes: self.oversized_meshes,
            huge_faces: self.huge_faces,
            coarse_meshes: self.coarse_meshes,
            deep_instancers: self.deep_instancers,
            instanced_lights: self.instanced_lights,
            ..Self::NONE
        };
        let rest = Self {
            oversized_meshes: 0,
            huge_faces: 0,
            coarse_meshes: 0,
            deep_instancers: 0,
            instanced_lights: 0,
            ..*self
        };
        [rest, limits].map(|part| part.entries().into_iter().filter(|(_, n)| *n > 0).collect())
    }

    /// One line that names every kind with its count, or `None` if nothing was dropped.
    #[must_use]
    pub fn message(&self) -> Option<String> {
        let mut line = String::new();
        for (entries, what) in self.by_cause().iter().zip(["bad data: ", "limits of the renderer: "]) {
            for (at, (text, n)) in entries.iter().enumerate() {
                let separator = match (at, line.is_empty()) {
                    (0, true) => "",
                    (0, false) => "; ",
                    _ => ", ",
                };
                // Writing to a String cannot fail.
                write!(line, "{separator}{}{n} {text}", if at == 0 { what } else { "" }).unwrap_or_default();
            }
        }
        (!line.is_empty()).then_some(line)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dropped_data_over_a_limit_is_not_reported_as_bad() {
        let dropped =
            DroppedData { hole_indices: 3, oversized_meshes: 1, lights: 2, deep_instancers: 4, ..DroppedData::NONE };
        assert_eq!(
            dropped.message().as_deref(),
            Some(
                "bad data: 3 hole indices out of range, 2 lights with unusable values; limits of the renderer: 1 meshes \
                 above the size limit, 4 instancers nested too deeply"
            )
        );
        let limits = DroppedData { coarse_meshes: 1, ..DroppedData::NONE };
        assert!(limits.message().is_some_and(|line| line.starts_with("limits of the renderer: 1 ")), "alone");
        assert_eq!(DroppedData::NONE.message(), None, "nothing");
    }
}
