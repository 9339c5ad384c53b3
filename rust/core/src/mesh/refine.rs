// SPDX-License-Identifier: Apache-2.0
//! Subdivision surfaces: turns a checked control mesh into triangles on its limit surface with `oocpt-subdiv`.
//!
//! The result is a mesh like any other: its faces keep the authored numbers, so values by face, subsets and element ids
//! stay valid; points, normals and all values by point or corner are those of the limit surface. Pure.

use glam::{DVec3, Vec3};
use oocpt_subdiv::{
    ControlMesh, Error, FaceVaryingChannel, LimitFacets, LimitSurface, MAX_RATE, SubdivisionRules, SubdivisionScheme,
    SurfaceData,
};
use rayon::prelude::*;

use super::cage::SubdivisionCage;
use super::creases::CreaseSharpness;
use super::demand::BuildDemand;
use super::dicing::{DicingRate, MAX_PIECES};
use super::displace::{DicedMesh, DisplacedVertices};
use super::patch::TakenPatch;
use super::pose::PointsPose;
use super::refine_values::ControlValues;
use super::topology::{MeshFace, MeshTopology};
use crate::array::TypedArray;
use crate::desc::{DroppedData, Interpolation, MeshDesc, Primvar, Subdivision};

/// Number of triangles of one mesh above which its edges are cut into fewer pieces.
pub const MAX_REFINED_TRIANGLES: u64 = 1 << 23;
/// Largest refine level that counts; larger ones are clamped.
const MAX_LEVEL: u8 = 8;

/// A mesh on its limit surface.
pub(crate) struct RefinedMesh {
    /// Triangles on the limit surface.
    pub(crate) topology: MeshTopology,
    /// Description with values for these triangles. Its own topology is still the control mesh.
    pub(crate) desc: MeshDesc,
    /// Poses at the keys of a moving mesh.
    pub(crate) poses: Vec<PointsPose>,
    /// Messages about textures that could not be read.
    pub(crate) notes: Vec<String>,
}

/// A control mesh that is refined.
#[derive(Clone, Copy)]
pub(super) struct ControlShape<'a> {
    pub(super) desc: &'a MeshDesc,
    pub(super) topology: &'a MeshTopology,
    pub(super) poses: &'a [PointsPose],
    /// The patch that it is, with the rings around; `None`: a whole mesh.
    pub(super) patch: Option<TakenPatch<'a>>,
}

/// The limit surface of a mesh with a checked topology, and at its poses, displaced if that is asked for; `None` if it
/// stays a polygon mesh, which `dropped` counts if it should not.
pub(super) fn refine(
    shape: ControlShape<'_>,
    demand: &BuildDemand<'_>,
    dropped: &mut DroppedData,
) -> Option<RefinedMesh> {
    let desc = shape.desc;
    if !demand.refines(desc) {
        return None;
    }
    // Dropped data count only if the mesh is refined.
    let mut own = DroppedData::default();
    let refined = if demand.reads_ptex() { None } else { try_refine(shape, demand, &mut own).ok() };
    match &refined {
        Some(_) => dropped.add(&own),
        None => dropped.unrefined_meshes += 1,
    }
    refined
}

fn try_refine(
    shape: ControlShape<'_>,
    demand: &BuildDemand<'_>,
    dropped: &mut DroppedData,
) -> Result<RefinedMesh, Error> {
    let ControlShape { desc, topology, poses, patch } = shape;
    let is_flat = matches!(desc.subdivision, Subdivision::None | Subdivision::Bilinear);
    let displaces = demand.displaces(desc);
    let cage = if is_flat && displaces {
        SubdivisionCage::flat(topology, dropped)?
    } else {
        SubdivisionCage::new(topology, dropped)?
    };
    let own_normals = desc.normals.as_ref().filter(|_| is_flat && displaces);
    let reads = |name: &str| demand.reads(name);
    let values = ControlValues::read(desc, own_normals, reads, topology, &cage.corners, dropped);
    let sharpness = CreaseSharpness::read(&desc.subdivision_tags, topology.points.len(), dropped);
    let channels: Vec<FaceVaryingChannel<'_>> = values.channels();
    let control = ControlMesh {
        rules: rules(desc),
        point_count: topology.points.len(),
        face_counts: &cage.counts,
        face_points: &cage.points,
        crease_pairs: &sharpness.crease_pairs,
        crease_weights: &sharpness.crease_weights,
        corner_points: &sharpness.corner_points,
        corner_weights: &sharpness.corner_weights,
        holes: &cage.holes,
        channels: &channels,
    };
    let surface = LimitSurface::new(&control)?;
    let none = DicingRate::default();
    let cutting = EdgeRates::new(desc, demand.dicing.unwrap_or(&none), displaces);
    let rates = match patch {
        Some(patch) => patch.rates(&surface, topology, &cage),
        None => rates(&surface, topology, &cutting, MAX_REFINED_TRIANGLES, dropped)?,
    };
    let (vertex, varying, channels) = (values.vertex(), values.varying(), values.channel_values());
    let tessellate = |points: &[[f32; 3]]| {
        // Points without a face may have any value.
        let positions: Vec<[f32; 3]> = points.iter().map(|p| if p[0].is_nan() { [0.0; 3] } else { *p }).collect();
        let data = SurfaceData { positions: positions.as_flattened(), vertex, varying, channels: &channels };
        // Borders of blocks affect bits, and are elsewhere in the patch beside.
        if patch.is_some() { surface.tessellate_as_one(&rates, &data) } else { surface.tessellate(&rates, &data) }
    };
    let mut facets = tessellate(&topology.points)?;
    // The rates are those of the frame's own time, so all poses are cut alike.
    let moved = poses.iter().map(|pose| tessellate(&pose.points)).collect::<Result<Vec<LimitFacets>, Error>>()?;
    let mut desc = values.replace(desc, &facets);
    let tessellated = TessellatedShape { shape, cage: &cage, is_flat };
    let displace =
        |facets: &mut LimitFacets, dropped: &mut DroppedData| tessellated.displace(facets, &desc, demand, dropped);
    let (normals, notes) = displace(&mut facets, dropped);
    let at_key = |(pose, mut facets): (&PointsPose, LimitFacets)| {
        let (normals, _) = displace(&mut facets, &mut DroppedData::default());
        let points = facets.positions.as_chunks::<3>().0.to_vec();
        PointsPose { normals: Some(TypedArray::of(normals)), ..PointsPose::at(pose.time, points) }
    };
    let poses = poses.iter().zip(moved).map(at_key).collect();
    let values = TypedArray::of(normals);
    desc.normals = Some(Primvar { interpolation: Interpolation::Vertex, values, indices: None });
    Ok(RefinedMesh { topology: refined_topology(topology, &cage, &facets), desc, poses, notes })
}

/// A control mesh that has been cut.
struct TessellatedShape<'a> {
    shape: ControlShape<'a>,
    cage: &'a SubdivisionCage,
    /// True if its faces are flat.
    is_flat: bool,
}

impl TessellatedShape<'_> {
    /// Moves the vertices if that is asked for; returns their normals, and messages for the user. `desc` has the values
    /// at the vertices.
    fn displace(
        &self,
        facets: &mut LimitFacets,
        desc: &MeshDesc,
        demand: &BuildDemand<'_>,
        dropped: &mut DroppedData,
    ) -> (Vec<[f32; 3]>, Vec<String>) {
        let normals = normals(facets, desc.left_handed);
        if !demand.displaces(desc) {
            return (normals, Vec::new());
        }
        let Self { shape: ControlShape { topology, patch, .. }, cage, is_flat } = *self;
        let (faces, face_count) = (&cage.faces[..], topology.face_count);
        let cut = DicedMesh { facets, faces, desc, face_count, normals, is_flat, is_patch: patch.is_some() };
        let DisplacedVertices { positions, normals, notes } = cut.displace(demand, dropped);
        facets.positions = positions.into_flattened();
        (normals, notes)
    }
}

fn rules(desc: &MeshDesc) -> SubdivisionRules {
    let tags = &desc.subdivision_tags;
    SubdivisionRules {
        scheme: match desc.subdivision {
            Subdivision::None | Subdivision::Bilinear => SubdivisionScheme::Bilinear,
            Subdivision::CatmullClark => SubdivisionScheme::CatmullClark,
            Subdivision::Loop => SubdivisionScheme::Loop,
        },
        boundary: tags.boundary,
        face_varying: tags.face_varying,
        triangles: tags.triangles,
        creasing: tags.creasing,
    }
}

/// The number of pieces into which each edge is cut.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EdgeRates<'a> {
    dicing: &'a DicingRate,
    least: i32,
    most: i32,
    /// True if edges are cut by the refine level alone, whatever the camera sees.
    by_level_alone: bool,
}

impl<'a> EdgeRates<'a> {
    pub(crate) fn new(desc: &MeshDesc, dicing: &'a DicingRate, displaces: bool) -> Self {
        Self {
            dicing,
            least: 1 << desc.refine_level.min(MAX_LEVEL),
            most: if displaces { MAX_RATE } else { MAX_PIECES },
            by_level_alone: desc.subdivision == Subdivision::Bilinear && !displaces,
        }
    }

    /// Pieces of the edge between two points.
    pub(crate) fn pieces(&self, a: DVec3, b: DVec3) -> i32 {
        match self.by_level_alone {
            true => self.least.min(self.most),
            false => self.dicing.pieces_up_to(a, b, self.least, self.most),
        }
    }

    /// The power of two that is nearest to the pieces of the edge between two points.
    pub(crate) fn octave(&self, a: DVec3, b: DVec3) -> i32 {
        self.dicing.octave(a, b)
    }

    /// Pieces of an edge of this octave: the limits are powers of two.
    pub(crate) fn of_octave(&self, octave: i32) -> i32 {
        (1 << octave.clamp(0, 30)).clamp(self.least.min(self.most), self.most)
    }
}

/// Number of pieces of each edge, fewer than wanted if the mesh would have more than `most` triangles.
fn rates(
    surface: &LimitSurface,
    topology: &MeshTopology,
    cutting: &EdgeRates<'_>,
    most: u64,
    dropped: &mut DroppedData,
) -> Result<Vec<i32>, Error> {
    let position = |point: i32| topology.position(point.cast_unsigned());
    let pieces = |[a, b]: &[i32; 2]| cutting.pieces(position(*a), position(*b));
    let mut rates: Vec<i32> = surface.edges().par_iter().map(pieces).collect();
    let expected = surface.expected_facets(&rates)?;
    if expected > most && rates.iter().any(|&rate| rate > 1) {
        dropped.coarse_meshes += 1;
        #[expect(clippy::cast_precision_loss, reason = "a ratio")]
        let share = (most as f64 / expected as f64).sqrt();
        #[expect(clippy::cast_possible_truncation, reason = "below MAX_RATE")]
        rates.iter_mut().for_each(|rate| *rate = ((f64::from(*rate) * share) as i32).max(1));
    }
    Ok(rates)
}

/// Unit normals on the outer side; where the surface has none, the mean of the triangles around.
fn normals(facets: &LimitFacets, left_handed: bool) -> Vec<[f32; 3]> {
    let side = if left_handed { -1.0 } else { 1.0 };
    let (positions, _) = facets.positions.as_chunks::<3>();
    let (limit, _) = facets.normals.as_chunks::<3>();
    let mut normals: Vec<[f32; 3]> = limit.iter().map(|n| n.map(|v| v * side)).collect();
    if limit.contains(&[0.0; 3]) {
        let mut sums = vec![DVec3::ZERO; limit.len()];
        for triangle in facets.triangles.as_chunks::<3>().0 {
            let corner = |k: usize| {
                let at = triangle.get(k).and_then(|&v| positions.get(v as usize));
                at.map_or(DVec3::ZERO, |&p| Vec3::from(p).as_dvec3())
            };
            let normal = (corner(1) - corner(0)).cross(corner(2) - corner(0));
            for &vertex in triangle {
                sums.iter_mut().skip(vertex as usize).take(1).for_each(|sum| *sum += normal);
            }
        }
        for ((normal, limit), sum) in normals.iter_mut().zip(limit).zip(sums) {
            if *limit == [0.0; 3] {
                let mean = sum.try_normalize().unwrap_or(DVec3::Z) * f64::from(side);
                *normal = mean.as_vec3().to_array();
            }
        }
    }
    normals
}

/// The triangles with the authored numbers of their faces.
fn refined_topology(control: &MeshTopology, cage: &SubdivisionCage, facets: &LimitFacets) -> MeshTopology {
    let face = |(at, &face): (usize, &u32)| {
        let index = cage.faces.get(face as usize).copied()?;
        Some(MeshFace { index, first: u32::try_from(3 * at).ok()?, count: 3, is_hole: false })
    };
    MeshTopology {
        faces: facets.faces.iter().enumerate().filter_map(face).collect(),
        corners: facets.triangles.clone(),
        points: facets.positions.as_chunks::<3>().0.to_vec(),
        face_count: control.face_count,
    }
}

#[cfg(test)]
mod tests {
    use super::super::topology::read_topology;
    use super::*;

    /// A flat grid of `side` squared quads.
    fn grid(side: i32) -> MeshDesc {
        let points = side + 1;
        let quad = |k: i32| {
            let at = k / side * points + k % side;
            [at, at + 1, at + 1 + points, at + points]
        };
        #[expect(clippy::cast_precision_loss, reason = "small numbers")]
        let place = |k: i32| [(k % points) as f32, (k / points) as f32, 0.0];
        MeshDesc {
            subdivision: Subdivision::CatmullClark,
            face_vertex_counts: TypedArray::of((0..side * side).map(|_| 4).collect::<Vec<i32>>()),
            face_vertex_indices: TypedArray::of::<i32>((0..side * side).flat_map(quad).collect()),
            points: TypedArray::of::<[f32; 3]>((0..points * points).map(place).collect()),
            ..MeshDesc::default()
        }
    }

    #[test]
    fn refined_triangles_are_capped() {
        let desc = grid(4);
        let mut dropped = DroppedData::default();
        let topology = read_topology(&desc, &mut dropped).unwrap();
        let cage = SubdivisionCage::new(&topology, &mut dropped).unwrap();
        let control = ControlMesh {
            point_count: topology.points.len(),
            face_counts: &cage.counts,
            face_points: &cage.points,
            ..ControlMesh::default()
        };
        let surface = LimitSurface::new(&control).unwrap();
        let mut rates = |most| {
            dropped = DroppedData::default();
            let dicing = DicingRate::default();
            let cutting = EdgeRates { dicing: &dicing, least: 32, most: MAX_PIECES, by_level_alone: false };
            let rates = rates(&surface, &topology, &cutting, most, &mut dropped).unwrap();
            (rates, dropped.coarse_meshes)
        };
        let all = 16 * 2 * 32 * 32;
        assert_eq!(rates(all), (vec![32; 40], 0), "all that was asked for");
        assert_eq!(rates(all - 1), (vec![31; 40], 1), "one triangle too many");
        assert_eq!(rates(all / 16), (vec![8; 40], 1), "a sixteenth");
        assert_eq!(rates(1), (vec![1; 40], 1), "an edge has one piece at least");
    }
}
