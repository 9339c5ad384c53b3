// SPDX-License-Identifier: Apache-2.0
//! Ptex files (`.ptx`): a texture for each face of a mesh, without texture coordinates (Burley & Lacewell 2008,
//! "Ptex: Per-Face Texture Mapping for Production Rendering"). A reader of version 1 of the file format (minor
//! versions differ in nothing that is read), and a writer. What is said of the format here was read in, and tried
//! with, the Ptex library 2.4.3.
//!
//! Guarantees: no bytes make this crate panic, read outside of a file, or loop without end; every length is checked
//! before it is used. Memory is taken in proportion to the file: up to 1032 times what is compressed in it (the most
//! that deflate can say), four times that for tables of faces, which take more space in memory. The exception are
//! texels that the file has once and the caller wants many times (constant faces and tiles): [`PtexFile::face_bytes`]
//! says beforehand how many bytes a face is, [`PtexFile::constant`] gives the one texel. Nothing is cached.
//!
//! Not read: reductions (coarser levels of faces), metadata (which may include the mesh itself), the edge filter mode
//! (whether texels are vectors in tangent space, to be rotated where they cross an edge).
//!
//! # Which face is which
//!
//! In a mesh of quads, faces come in the order of the mesh: one for a polygon of four corners, n consecutive ones for
//! a polygon of n other than 4, its *subfaces*. u and v of a quad are (0, 0) at its first vertex, (1, 0) at the
//! second, (1, 1) at the third and (0, 1) at the last. Subface i has (0, 0) at the polygon's vertex i, (1, 0) at the
//! midpoint of the edge from there to vertex i + 1, (1, 1) at the centre of the polygon, and (0, 1) at the midpoint
//! of the edge from vertex i - 1. The file stores only neighbours; that numbering is the one of `Far::PtexIndices` in
//! `OpenSubdiv`, and its neighbours are: beyond edge 1 subface i + 1 (its edge 2), beyond edge 2 subface i - 1 (its
//! edge 1), beyond edges 0 and 3 other polygons. A subface covers about a quarter of what a quad does, so that one of
//! 2^n texels a side is as fine as a quad of 2^(n + 1).
//!
//! In a mesh of triangles, u and v are (0, 0), (1, 0) and (0, 1) at the vertices, and edges are 0 where v = 0, 1
//! where u + v = 1, 2 where u = 0. There are no subfaces. A square image of r x r texels holds r^2 triangular ones:
//! cell (i, j) of the grid, with i + j < r, has its lower half (the "even" one, with the cell's corner (i, j)) in
//! column i, row j, and, where i + j < r - 1, its upper half (the "odd" one) in column r - 1 - j, row r - 1 - i.
//!
//! # Neighbours
//!
//! Edges are walked counter-clockwise, and the edges of two neighbours run against each other, always: parameter t
//! along one is 1 - t along the other. So a neighbour is reached by a shift and a rotation, never by a mirror; a mesh
//! whose faces are not oriented alike cannot be said. If (u, v) is a point beyond edge e of a quad, less the one unit
//! that brings it into the unit square, and e' the neighbour's edge, then the neighbour's coordinates of it are, by
//! (e - e' + 2) mod 4: 0 (u, v), 1 (v, 1 - u), 2 (1 - u, 1 - v), 3 (1 - v, u).
//!
//! Beyond the edge of a quad may be two subfaces, of one polygon. [`PtexFace::adjacent`] names the one at the first
//! half of the edge, walked counter-clockwise (t < 1/2), with its edge there, which is 3. The other one, at t > 1/2, is
//! what that one has beyond its edge (3 + 3) mod 4 = 2; its edge 0 is the one at the quad. Each of the two covers a
//! half of the edge with all of its own. From a subface to a quad, the quad is named by both; the subface is at the
//! first half of the quad's edge if the quad names it there, else at the second half. Between subfaces of two
//! polygons all is as between quads.
//!
//! # What the filters of the Ptex library do with it
//!
//! * The filter's width is at least a texel of the face of the point. Neighbours finer than that are read from their
//!   reductions, coarser ones at their own resolution, with the weights of the texels that become one added up.
//! * A constant face takes part at the resolution that the file says, which is the one that its writer was given,
//!   however little is stored: at a point in a constant face of 1 x 1 texels, a bilinear filter begins to blend with
//!   the neighbour half a face away from it, in one of 32 x 32 texels 1/64 of a face away. A face that was never
//!   written is one of 1 x 1 black texel, without neighbours.
//! * Around a vertex of four faces, the one at the corner takes part as those at the edges do. Of five or more, all
//!   corner faces get the same, symmetric weights; of two or three, what would fall beyond the corner is left out,
//!   and the rest weighs more.
//! * Beyond an edge without a neighbour: [`BorderMode::Clamp`] and [`BorderMode::Periodic`] give the weight to the
//!   texels at the edge; [`BorderMode::Black`] counts it as zeros, without normalising, so that borders darken (a
//!   bilinear filter gives a half of the texel at the very edge). Points outside of 0 to 1 are clamped, black, or
//!   wrapped, respectively: that is all that is periodic about `Periodic`, unless the face is its own neighbour. The
//!   modes are those of the file, along u and v of each face. Triangles ignore them: what falls outside is left out,
//!   and the rest weighs more.
//! * Colours are stored as they are, not multiplied by alpha; reductions, averages and filters (if asked) multiply
//!   first.

#![forbid(unsafe_code)]

mod edits;
mod error;
mod face;
mod file;
mod format;
mod inflate;
mod read;
mod source;
mod tables;
mod texels;
mod write;

pub use error::PtexError;
pub use face::{BorderMode, DataType, MeshType, PtexFace};
pub use file::PtexFile;
pub use source::ReadAt;
pub use write::PtexWriter;

/// Most faces of a file.
pub const MAX_FACES: u32 = 1 << 26;
/// Most channels of a texel.
pub const MAX_CHANNELS: u32 = 64;
/// Most texels of a face along u and along v, as a logarithm of base 2.
pub const MAX_LOG2: u8 = 14;
/// Most bytes of the texels of a face, and of each table of a file once inflated.
pub const MAX_BYTES: u64 = 1 << 31;
/// Most edits of a file.
pub const MAX_EDITS: u32 = 1 << 24;
