// SPDX-License-Identifier: Apache-2.0
//! The boundary to C++ (`cpp/subdiv/limitSurface.h`). C++ does not repeat the checks of [`crate::ControlMesh`].
#![allow(unsafe_code, reason = "cxx writes the calls")]
#![allow(missing_docs, unreachable_pub, unused_qualifications, reason = "cxx writes the calls")]
#![allow(clippy::multiple_unsafe_ops_per_block, reason = "cxx writes the calls")]

pub(crate) use bridge::*;

#[cxx::bridge(namespace = "oocpt::subdiv")]
mod bridge {
    /// Rules of subdivision, as the numbers of OpenSubdiv's enumerations.
    #[derive(Clone, Copy, Debug)]
    struct SchemeRules {
        scheme: i32,
        boundary: i32,
        face_varying: i32,
        creasing: i32,
        triangles: i32,
    }

    /// Checked topology.
    struct MeshTopology<'a> {
        point_count: i32,
        face_counts: &'a [i32],
        face_points: &'a [i32],
        crease_pairs: &'a [i32],
        crease_weights: &'a [f32],
        corner_points: &'a [i32],
        corner_weights: &'a [f32],
        holes: &'a [i32],
        /// Number of values of each channel.
        channel_counts: &'a [i32],
        /// Value of each corner, channel by channel.
        channel_values: &'a [i32],
    }

    /// The faces that are cut, and the rates of their edges.
    struct FaceCut<'a> {
        /// Number of pieces of each edge.
        rates: &'a [i32],
        /// Number of the first inner place of each edge; control vertices are places too.
        edge_sites: &'a [i32],
        first_face: i32,
        end_face: i32,
    }

    /// The values that are evaluated. Widths are floats of a value.
    struct SurfaceValues<'a> {
        positions: &'a [f64],
        vertex: &'a [f32],
        vertex_width: i32,
        varying: &'a [f32],
        varying_width: i32,
        /// Face-varying values, channel by channel.
        face_varying: &'a [f32],
        face_varying_widths: &'a [i32],
    }

    unsafe extern "C++" {
        include!("subdiv/limitSurface.h");

        type LimitSurface;
        type Facets;

        fn new_limit_surface(rules: SchemeRules, topology: &MeshTopology<'_>) -> Result<UniquePtr<LimitSurface>>;
        /// End points of the edges, two for each edge.
        fn edges(self: &LimitSurface) -> &[i32];
        /// Approximate number of triangles that these rates give in each face.
        fn expected_facets(self: &LimitSurface, rates: &[i32], facets: &mut [u64]) -> Result<()>;
        fn tessellate(self: &LimitSurface, cut: &FaceCut<'_>, values: &SurfaceValues<'_>) -> Result<UniquePtr<Facets>>;

        fn positions(self: &Facets) -> &[f32];
        fn normals(self: &Facets) -> &[f32];
        fn vertex(self: &Facets) -> &[f32];
        fn varying(self: &Facets) -> &[f32];
        fn face_varying(self: &Facets) -> &[f32];
        fn triangles(self: &Facets) -> &[i32];
        fn faces(self: &Facets) -> &[i32];
        fn sites(self: &Facets) -> &[i32];
    }
}

// SAFETY: the object is never changed once it is made, and has no state that depends on a thread.
unsafe impl Send for LimitSurface {}
// SAFETY: all calls are `const`; the cache of its factory is the only thing that changes, under a lock.
unsafe impl Sync for LimitSurface {}

// SAFETY: vectors of numbers, without state that depends on a thread.
unsafe impl Send for Facets {}
// SAFETY: all calls are `const` and change nothing.
unsafe impl Sync for Facets {}
