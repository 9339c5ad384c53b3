// SPDX-License-Identifier: Apache-2.0
//! Subdivision surfaces: from a checked control mesh to triangles on its limit surface, through `oocpt-subdiv`.
//!
//! The result is a mesh like any other: its faces keep the authored numbers, so values by face, subsets and element ids
//! go on as they were; points, normals and all values by point or corner are those of the limit surface. Pure.

use std::collections::HashSet;

use glam::{DVec3, Vec3};
use oocpt_subdiv::{Channel, Control, Data, Error, Facets, LimitSurface, MAX_RATE, Rules, Scheme};

use super::WantedPrimvar;
use super::creases::Sharpness;
use super::dicing::Dicing;
use super::refine_values::ControlValues;
use super::topology::{Face, Topology};
use crate::array::TypedArray;
use crate::desc::{CurveBasis, DroppedData, Interpolation, MeshDesc, Primvar, Shape, Subdivision};
use crate::material::PTEX_SET_ID;

/// Triangles of one mesh above which its edges are cut into fewer pieces.
pub const MAX_REFINED_TRIANGLES: u64 = 1 << 23;
/// Largest exponent of a refine level that counts.
const MAX_LEVEL: u8 = 8;

/// A mesh on its limit surface.
pub(crate) struct Refined {
    /// Triangles.
    pub(crate) topology: Topology,
    /// The description with values for it. Its own topology is the control mesh's still.
    pub(crate) desc: MeshDesc,
}

/// True where a mesh is refined at all. Ptex is laid out for faces, not for what they are cut into: such meshes stay
/// as they are ([`DroppedData::unrefined_meshes`] counts them).
pub(crate) fn is_refined(desc: &MeshDesc, pixels: f64) -> bool {
    match (&desc.shape, desc.subdivision) {
        // Cubic curves are cut; what nothing is cut of stays the same at any rate.
        (Shape::Curves(curves), _) => curves.basis != CurveBasis::Linear && (pixels > 0.0 || desc.refine_level > 0),
        (Shape::Points, _) | (_, Subdivision::None) => false,
        // Flat where it is seen as flat: only who asks for more gets it.
        (_, Subdivision::Bilinear) => desc.refine_level > 0,
        (_, Subdivision::CatmullClark | Subdivision::Loop) => pixels > 0.0 || desc.refine_level > 0,
    }
}

/// The limit surface of a mesh with the checked `topology`; `None` where it stays a polygon mesh, and `dropped` says
/// so if it should not.
pub(crate) fn refine(
    desc: &MeshDesc,
    wanted: &[WantedPrimvar],
    topology: &Topology,
    dicing: &Dicing,
    dropped: &mut DroppedData,
) -> Option<Refined> {
    if !is_refined(desc, dicing.pixels) {
        return None;
    }
    // What is dropped counts only if the mesh is refined.
    let mut own = DroppedData::default();
    let refined = if wanted.iter().any(|wanted| wanted.id == PTEX_SET_ID) {
        None
    } else {
        try_refine(desc, wanted, topology, dicing, &mut own).ok()
    };
    match &refined {
        Some(_) => dropped.add(&own),
        None => dropped.unrefined_meshes += 1,
    }
    refined
}

fn try_refine(
    desc: &MeshDesc,
    wanted: &[WantedPrimvar],
    topology: &Topology,
    dicing: &Dicing,
    dropped: &mut DroppedData,
) -> Result<Refined, Error> {
    let cage = Cage::new(topology, dropped)?;
    let values = ControlValues::read(desc, wanted, topology, &cage.corners, dropped);
    let sharpness = Sharpness::read(&desc.subdivision_tags, topology.points.len(), dropped);
    let channels: Vec<Channel<'_>> = values.channels();
    let tags = &desc.subdivision_tags;
    let control = Control {
        rules: Rules {
            scheme: match desc.subdivision {
                Subdivision::None | Subdivision::Bilinear => Scheme::Bilinear,
                Subdivision::CatmullClark => Scheme::CatmullClark,
                Subdivision::Loop => Scheme::Loop,
            },
            boundary: tags.boundary,
            face_varying: tags.face_varying,
            triangles: tags.triangles,
            creasing: tags.creasing,
        },
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
    let rates = rates(&surface, desc, topology, dicing, MAX_REFINED_TRIANGLES, dropped)?;
    // Points of no face may be anything.
    let positions: Vec<[f32; 3]> =
        topology.points.iter().map(|point| if point[0].is_nan() { [0.0; 3] } else { *point }).collect();
    let (vertex, varying, channels) = (values.vertex(), values.varying(), values.channel_values());
    let data = Data { positions: positions.as_flattened(), vertex, varying, channels: &channels };
    let facets = surface.tessellate(&rates, &data)?;
    let desc = values.replace(desc, &facets, normals(&facets, desc.left_handed));
    Ok(Refined { topology: refined_topology(topology, &cage, &facets), desc })
}

/// Faces as OpenSubdiv takes them: none has a point twice.
#[derive(Default)]
struct Cage {
    counts: Vec<i32>,
    points: Vec<i32>,
    /// Authored corner of each of `points`.
    corners: Vec<u32>,
    holes: Vec<i32>,
    /// Authored number of each face.
    faces: Vec<u32>,
}

impl Cage {
    /// Points that follow themselves, as at the poles of many spheres, count once; faces that come back to a point are
    /// left out.
    fn new(topology: &Topology, dropped: &mut DroppedData) -> Result<Self, Error> {
        let mut cage = Self::default();
        let mut seen = HashSet::new();
        for face in &topology.faces {
            let points = topology.face_corners(face);
            let Some(&last) = points.last() else { continue };
            let (mut before, start) = (last, cage.points.len());
            for (&point, corner) in points.iter().zip(face.first..) {
                if point != before || points.len() == 1 {
                    cage.points.push(point.cast_signed());
                    cage.corners.push(corner);
                }
                before = point;
            }
            seen.clear();
            let kept = cage.points.get(start..).unwrap_or_default();
            if kept.len() < 3 || !kept.iter().all(|&point| seen.insert(point)) {
                dropped.folded_faces += 1;
                cage.points.truncate(start);
                cage.corners.truncate(start);
                continue;
            }
            if face.is_hole {
                cage.holes.push(int(cage.counts.len())?);
            }
            cage.counts.push(int(kept.len())?);
            cage.faces.push(face.index);
        }
        if cage.faces.is_empty() { Err(Error::Invalid("no face")) } else { Ok(cage) }
    }
}

fn int(count: usize) -> Result<i32, Error> {
    i32::try_from(count).map_err(|_too_large| Error::Invalid("more than can be numbered"))
}

/// Pieces of each edge, fewer than wanted where the mesh would have more than `most` triangles.
fn rates(
    surface: &LimitSurface,
    desc: &MeshDesc,
    topology: &Topology,
    dicing: &Dicing,
    most: u64,
    dropped: &mut DroppedData,
) -> Result<Vec<i32>, Error> {
    let least = 1 << desc.refine_level.min(MAX_LEVEL);
    let is_flat = desc.subdivision == Subdivision::Bilinear;
    let position = |point: i32| topology.position(point.cast_unsigned());
    let pieces = |[a, b]: &[i32; 2]| match is_flat {
        true => i32::min(least, MAX_RATE),
        false => dicing.pieces(position(*a), position(*b), least),
    };
    let mut rates: Vec<i32> = surface.edges().iter().map(pieces).collect();
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
fn normals(facets: &Facets, left_handed: bool) -> Primvar {
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
    Primvar { interpolation: Interpolation::Vertex, values: TypedArray::of(normals), indices: None }
}

/// The triangles with the authored numbers of their faces.
fn refined_topology(control: &Topology, cage: &Cage, facets: &Facets) -> Topology {
    let face = |(at, &face): (usize, &u32)| {
        let index = cage.faces.get(face as usize).copied()?;
        Some(Face { index, first: u32::try_from(3 * at).ok()?, count: 3, is_hole: false })
    };
    Topology {
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
    fn grid(side: i32, refine_level: u8) -> MeshDesc {
        let points = side + 1;
        let quad = |k: i32| {
            let at = k / side * points + k % side;
            [at, at + 1, at + 1 + points, at + points]
        };
        #[expect(clippy::cast_precision_loss, reason = "small numbers")]
        let place = |k: i32| [(k % points) as f32, (k / points) as f32, 0.0];
        MeshDesc {
            subdivision: Subdivision::CatmullClark,
            refine_level,
            face_vertex_counts: TypedArray::of((0..side * side).map(|_| 4).collect::<Vec<i32>>()),
            face_vertex_indices: TypedArray::of::<i32>((0..side * side).flat_map(quad).collect()),
            points: TypedArray::of::<[f32; 3]>((0..points * points).map(place).collect()),
            ..MeshDesc::default()
        }
    }

    #[test]
    fn a_mesh_has_at_most_so_many_triangles() {
        let desc = grid(4, 5);
        let mut dropped = DroppedData::default();
        let topology = read_topology(&desc, &mut dropped).unwrap();
        let cage = Cage::new(&topology, &mut dropped).unwrap();
        let control = Control {
            point_count: topology.points.len(),
            face_counts: &cage.counts,
            face_points: &cage.points,
            ..Control::default()
        };
        let surface = LimitSurface::new(&control).unwrap();
        let mut rates = |most| {
            dropped = DroppedData::default();
            let rates = rates(&surface, &desc, &topology, &Dicing::default(), most, &mut dropped).unwrap();
            (rates, dropped.coarse_meshes)
        };
        let all = 16 * 2 * 32 * 32;
        assert_eq!(rates(all), (vec![32; 40], 0), "all that was asked for");
        assert_eq!(rates(all - 1), (vec![31; 40], 1), "one triangle too many");
        assert_eq!(rates(all / 16), (vec![8; 40], 1), "a sixteenth");
        assert_eq!(rates(1), (vec![1; 40], 1), "an edge has one piece at least");
    }
}
