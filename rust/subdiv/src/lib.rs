// SPDX-License-Identifier: Apache-2.0
//! Limit surfaces of subdivision meshes, by Pixar's OpenSubdiv (its interface `Bfr`): Catmull-Clark, Loop and bilinear,
//! with creases, corners, holes and the rules of `UsdGeomMesh`.
//!
//! [`LimitSurface::new`] takes a control mesh, [`LimitSurface::tessellate`] gives triangles whose vertices lie on the
//! limit surface, with exact normals. Each edge of the control mesh is cut into as many pieces as its rate says, so
//! neighbours always fit: faces share the positions on their edges, bit for bit. Positions and normals are in object
//! space, in the units of the points.
//!
//! Any thread; [`LimitSurface::tessellate`] works on the caller's rayon pool. No control mesh can crash a call:
//! unusable input is an [`Error`]. The library is linked statically with hidden symbols, so that it does not meet the
//! one that a host may have loaded.

mod check;
mod ffi;
mod seam;

use std::fmt;
use std::ops::Range;

use cxx::UniquePtr;
use rayon::prelude::*;
use seam::SeamJoiner;

pub use check::{MAX_FACE_POINTS, MAX_RATE, MAX_VALENCE};

/// Number of triangles of a block of faces: a block takes some milliseconds. Block borders affect the bits of the
/// result.
const BLOCK_FACETS: u64 = 1 << 14;

/// Values of `subdivisionScheme`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum SubdivisionScheme {
    /// Faces become bilinear patches.
    Bilinear,
    /// Catmull and Clark 1978.
    #[default]
    CatmullClark,
    /// Loop 1987; triangles only.
    Loop,
}

/// Values of `interpolateBoundary`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum BoundaryRule {
    /// Faces at a boundary have no surface.
    None,
    /// Boundaries are smooth curves.
    EdgeOnly,
    /// Boundaries are smooth curves with sharp corners where a vertex has one face.
    #[default]
    EdgeAndCorner,
}

/// Values of `faceVaryingLinearInterpolation`: the places at which face-varying values are interpolated linearly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum FaceVaryingLinear {
    /// No value is interpolated linearly.
    None,
    /// Values at corners are linear.
    CornersOnly,
    /// Values are linear at corners, and where more than two islands meet.
    #[default]
    CornersPlus1,
    /// As `CornersPlus1`, and linear at darts.
    CornersPlus2,
    /// Values along boundaries are linear.
    Boundaries,
    /// All values are linear.
    All,
}

/// Values of `triangleSubdivisionRule`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum TriangleRule {
    /// Triangles are subdivided as other faces.
    #[default]
    CatmullClark,
    /// Weights that make triangles of a Catmull-Clark mesh smoother.
    Smooth,
}

/// Rule by which sharpness decreases from level to level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum CreaseRule {
    /// Sharpness decreases by one per level.
    #[default]
    Uniform,
    /// Sharpness is averaged along the crease.
    Chaikin,
}

/// The rules of a control mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct SubdivisionRules {
    /// Subdivision scheme.
    pub scheme: SubdivisionScheme,
    /// Rule for boundaries.
    pub boundary: BoundaryRule,
    /// Rule for face-varying values.
    pub face_varying: FaceVaryingLinear,
    /// Rule for triangles of a Catmull-Clark mesh.
    pub triangles: TriangleRule,
    /// Rule for semi-sharp creases.
    pub creasing: CreaseRule,
}

/// Values that belong to corners of faces, and how corners share them.
#[derive(Clone, Copy, Debug)]
pub struct FaceVaryingChannel<'a> {
    /// Number of the value of each corner.
    pub corners: &'a [i32],
    /// Number of values.
    pub count: usize,
}

/// A control mesh. All indices are of points, all arrays may be empty.
#[derive(Clone, Copy, Debug, Default)]
pub struct ControlMesh<'a> {
    /// Subdivision rules.
    pub rules: SubdivisionRules,
    /// Number of points.
    pub point_count: usize,
    /// Number of corners of each face.
    pub face_counts: &'a [i32],
    /// Point of each corner.
    pub face_points: &'a [i32],
    /// Two points for each sharp edge.
    pub crease_pairs: &'a [i32],
    /// Sharpness of each sharp edge; 10 and more is infinitely sharp.
    pub crease_weights: &'a [f32],
    /// Sharp points.
    pub corner_points: &'a [i32],
    /// Sharpness of these points.
    pub corner_weights: &'a [f32],
    /// Faces without a surface.
    pub holes: &'a [i32],
    /// Face-varying values.
    pub channels: &'a [FaceVaryingChannel<'a>],
}

/// Some values of `width` floats each.
#[derive(Clone, Copy, Debug, Default)]
pub struct PackedValues<'a> {
    /// Number of floats of a value; 0 = there are none.
    pub width: usize,
    /// The values, one after the other.
    pub floats: &'a [f32],
}

/// The data that are evaluated on a surface.
#[derive(Clone, Copy, Debug, Default)]
pub struct SurfaceData<'a> {
    /// Position of each point, 3 floats.
    pub positions: &'a [f32],
    /// Smooth values of points.
    pub vertex: PackedValues<'a>,
    /// Values of points, linear over faces.
    pub varying: PackedValues<'a>,
    /// Values of each channel.
    pub channels: &'a [PackedValues<'a>],
}

/// Triangles on a limit surface. Where normals or face-varying values differ from face to face, several vertices have
/// one position.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LimitFacets {
    /// Positions, three floats for each vertex.
    pub positions: Vec<f32>,
    /// Unit normals of the right-handed surface, three floats a vertex; zero where the surface has none.
    pub normals: Vec<f32>,
    /// Values of `SurfaceData::vertex` at each vertex.
    pub vertex: Vec<f32>,
    /// Values of `SurfaceData::varying` at each vertex.
    pub varying: Vec<f32>,
    /// Values of all channels at each vertex, interleaved.
    pub face_varying: Vec<f32>,
    /// Triangles, three vertices for each.
    pub triangles: Vec<u32>,
    /// Control face of each triangle.
    pub faces: Vec<u32>,
    /// For each vertex the first one at the same position on the edges and corners of the same control faces. Vertices
    /// that only touch are not joined.
    pub places: Vec<u32>,
}

/// Reason why there is no surface.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// The control mesh is not usable.
    #[error("{0}")]
    Invalid(&'static str),
    /// OpenSubdiv reported an error.
    #[error("{0}")]
    Library(String),
}

impl From<cxx::Exception> for Error {
    fn from(exception: cxx::Exception) -> Self {
        Self::Library(exception.what().to_owned())
    }
}

/// The surface of a control mesh, without positions.
pub struct LimitSurface {
    inner: UniquePtr<ffi::LimitSurface>,
    point_count: usize,
    face_count: usize,
    channel_counts: Vec<usize>,
}

impl fmt::Debug for LimitSurface {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("LimitSurface").field("points", &self.point_count).field("edges", &self.edges().len()).finish()
    }
}

impl LimitSurface {
    /// The surface of `control`.
    ///
    /// # Errors
    /// When an index or length is out of range, a face has a point twice, fewer than three or more than
    /// [`MAX_FACE_POINTS`] points, more than [`MAX_VALENCE`] faces meet at a point, or Loop's scheme meets a face that
    /// is no triangle.
    pub fn new(control: &ControlMesh<'_>) -> Result<Self, Error> {
        check::control(control)?;
        let channel_counts: Vec<usize> = control.channels.iter().map(|channel| channel.count).collect();
        let counts = channel_counts.iter().map(|&count| check::int(count)).collect::<Result<Vec<_>, _>>()?;
        let channel_values: Vec<i32> = control.channels.iter().flat_map(|channel| channel.corners).copied().collect();
        let topology = ffi::MeshTopology {
            point_count: check::int(control.point_count)?,
            face_counts: control.face_counts,
            face_points: control.face_points,
            crease_pairs: control.crease_pairs,
            crease_weights: control.crease_weights,
            corner_points: control.corner_points,
            corner_weights: control.corner_weights,
            holes: control.holes,
            channel_counts: &counts,
            channel_values: &channel_values,
        };
        let inner = ffi::new_limit_surface(rules(control.rules), &topology)?;
        let (point_count, face_count) = (control.point_count, control.face_counts.len());
        Ok(Self { inner, point_count, face_count, channel_counts })
    }

    /// The two points of each edge.
    #[must_use]
    pub fn edges(&self) -> &[[i32; 2]] {
        self.inner.edges().as_chunks().0
    }

    /// Triangles that [`Self::tessellate`] makes with these rates, within a factor of two; at least as many as faces.
    ///
    /// # Errors
    /// As [`Self::tessellate`].
    pub fn expected_facets(&self, rates: &[i32]) -> Result<u64, Error> {
        Ok(self.expected_by_face(rates)?.into_iter().sum())
    }

    fn expected_by_face(&self, rates: &[i32]) -> Result<Vec<u64>, Error> {
        check::rates(rates, self.edges().len())?;
        let mut facets = vec![0; self.face_count];
        self.inner.expected_facets(rates, &mut facets)?;
        Ok(facets)
    }

    /// Triangles on the surface; `rates` is the number of pieces of each of [`Self::edges`]. Blocks of faces are cut in
    /// parallel, on the caller's rayon pool; the result is the same for any number of threads.
    ///
    /// # Errors
    /// When lengths do not fit, or a rate is not in `1..=MAX_RATE`.
    pub fn tessellate(&self, rates: &[i32], data: &SurfaceData<'_>) -> Result<LimitFacets, Error> {
        self.tessellate_in_blocks(rates, data, BLOCK_FACETS)
    }

    /// As [`Self::tessellate`], as one block, on the caller's thread: the vertices at a place depend on the faces
    /// around it alone, so two meshes that have these faces in the same order agree about them, bit for bit.
    ///
    /// # Errors
    /// As [`Self::tessellate`].
    pub fn tessellate_as_one(&self, rates: &[i32], data: &SurfaceData<'_>) -> Result<LimitFacets, Error> {
        self.tessellate_in_blocks(rates, data, u64::MAX)
    }

    fn tessellate_in_blocks(
        &self,
        rates: &[i32],
        data: &SurfaceData<'_>,
        block_facets: u64,
    ) -> Result<LimitFacets, Error> {
        let expected = self.expected_by_face(rates)?;
        check::data(data, self.point_count, &self.channel_counts)?;
        let widths = data.channels.iter().map(|values| check::int(values.width)).collect::<Result<Vec<_>, _>>()?;
        let face_varying: Vec<f32> = data.channels.iter().flat_map(|values| values.floats).copied().collect();
        let positions: Vec<f64> = data.positions.iter().map(|&float| f64::from(float)).collect();
        let values = ffi::SurfaceValues {
            positions: &positions,
            vertex: data.vertex.floats,
            vertex_width: check::int(data.vertex.width)?,
            varying: data.varying.floats,
            varying_width: check::int(data.varying.width)?,
            face_varying: &face_varying,
            face_varying_widths: &widths,
        };
        let (edge_sites, site_count) = self.edge_sites(rates)?;
        let block = |faces: &Range<usize>| -> Result<_, Error> {
            let (first_face, end_face) = (check::int(faces.start)?, check::int(faces.end)?);
            let cut = ffi::FaceCut { rates, edge_sites: &edge_sites, first_face, end_face };
            Ok(self.inner.tessellate(&cut, &values)?)
        };
        let blocks: Vec<_> = blocks(&expected, block_facets).par_iter().map(block).collect::<Result<_, _>>()?;
        let width = data.channels.iter().map(|values| values.width).sum();
        let mut seam = SeamJoiner::new(site_count, width);
        for block in blocks {
            seam.add(block.as_ref().ok_or(Error::Invalid("no triangles"))?)?;
        }
        Ok(seam.facets)
    }

    /// The number of the first place inside each edge, and the number of all places: control points come first.
    fn edge_sites(&self, rates: &[i32]) -> Result<(Vec<i32>, usize), Error> {
        let mut sites = self.point_count;
        let first = |rate: &i32| {
            let first = check::int(sites);
            sites += usize::try_from(rate - 1).unwrap_or(0);
            first
        };
        let edge_sites = rates.iter().map(first).collect::<Result<_, _>>()?;
        check::int(sites)?;
        Ok((edge_sites, sites))
    }
}

/// Ranges of faces that are cut together, so many that about `block_facets` triangles result.
fn blocks(expected: &[u64], block_facets: u64) -> Vec<Range<usize>> {
    let (mut blocks, mut start, mut facets) = (Vec::new(), 0, 0);
    for (face, of_face) in expected.iter().enumerate() {
        facets += of_face;
        if facets >= block_facets {
            blocks.push(start..face + 1);
            (start, facets) = (face + 1, 0);
        }
    }
    blocks.push(start..expected.len());
    blocks
}

/// Rules as OpenSubdiv numbers them (`Sdc::SchemeType`, `Sdc::Options`).
fn rules(rules: SubdivisionRules) -> ffi::SchemeRules {
    ffi::SchemeRules {
        scheme: match rules.scheme {
            SubdivisionScheme::Bilinear => 0,
            SubdivisionScheme::CatmullClark => 1,
            SubdivisionScheme::Loop => 2,
        },
        boundary: match rules.boundary {
            BoundaryRule::None => 0,
            BoundaryRule::EdgeOnly => 1,
            BoundaryRule::EdgeAndCorner => 2,
        },
        face_varying: match rules.face_varying {
            FaceVaryingLinear::None => 0,
            FaceVaryingLinear::CornersOnly => 1,
            FaceVaryingLinear::CornersPlus1 => 2,
            FaceVaryingLinear::CornersPlus2 => 3,
            FaceVaryingLinear::Boundaries => 4,
            FaceVaryingLinear::All => 5,
        },
        triangles: match rules.triangles {
            TriangleRule::CatmullClark => 0,
            TriangleRule::Smooth => 1,
        },
        creasing: match rules.creasing {
            CreaseRule::Uniform => 0,
            CreaseRule::Chaikin => 1,
        },
    }
}
