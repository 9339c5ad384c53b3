// SPDX-License-Identifier: Apache-2.0
//! Faces as OpenSubdiv takes them: none has a point twice. Pure.

use glam::DVec3;
use oocpt_subdiv::Error;
use rustc_hash::FxHashSet;

use super::topology::{MeshFace, MeshTopology};
use super::triangulate::FaceTriangulator;
use crate::desc::DroppedData;

/// See the module.
#[derive(Default)]
pub(crate) struct SubdivisionCage {
    pub(crate) counts: Vec<i32>,
    pub(crate) points: Vec<i32>,
    /// Authored corner of each of `points`.
    pub(crate) corners: Vec<u32>,
    pub(crate) holes: Vec<i32>,
    /// Authored number of each face.
    pub(crate) faces: Vec<u32>,
}

impl SubdivisionCage {
    /// Points that follow themselves, as at the poles of many spheres, count once; faces that come back to a point are
    /// left out.
    pub(crate) fn new(topology: &MeshTopology, dropped: &mut DroppedData) -> Result<Self, Error> {
        Self::of(topology, false, dropped)
    }

    /// As [`Self::new`], of faces that are flat: those of more than four corners and those that are not convex are cut
    /// into triangles, since a bilinear patch would not cover them.
    pub(crate) fn flat(topology: &MeshTopology, dropped: &mut DroppedData) -> Result<Self, Error> {
        Self::of(topology, true, dropped)
    }

    fn of(topology: &MeshTopology, is_flat: bool, dropped: &mut DroppedData) -> Result<Self, Error> {
        let mut cage = Self::default();
        let (mut seen, mut corners) = (FxHashSet::default(), Vec::new());
        let (mut triangulator, mut ears) = (FaceTriangulator::default(), Vec::new());
        for face in &topology.faces {
            let points = topology.face_corners(face);
            let Some(&last) = points.last() else { continue };
            let mut before = last;
            corners.clear();
            for (&point, corner) in points.iter().zip(face.first..) {
                if point != before || points.len() == 1 {
                    corners.push((point, corner));
                }
                before = point;
            }
            if corners.len() < 3 || has_twice(&corners, &mut seen) {
                dropped.folded_faces += 1;
                continue;
            }
            if !is_flat || corners.len() == 3 {
                cage.add(face, corners.iter().copied())?;
                continue;
            }
            let places: Vec<DVec3> = corners.iter().map(|(point, _)| topology.position(*point)).collect();
            let normal = topology.face_normal(face);
            if places.len() == 4 && is_convex(&places, normal) {
                cage.add(face, corners.iter().copied())?;
                continue;
            }
            triangulator.triangulate(&places, normal, &mut ears);
            for ear in &ears {
                cage.add(face, ear.iter().filter_map(|&corner| corners.get(corner as usize).copied()))?;
            }
        }
        if cage.faces.is_empty() { Err(Error::Invalid("no face")) } else { Ok(cage) }
    }

    /// Adds a face with these points and authored corners.
    fn add(&mut self, face: &MeshFace, corners: impl Iterator<Item = (u32, u32)>) -> Result<(), Error> {
        let start = self.points.len();
        for (point, corner) in corners {
            self.points.push(point.cast_signed());
            self.corners.push(corner);
        }
        if face.is_hole {
            self.holes.push(int(self.counts.len())?);
        }
        self.counts.push(int(self.points.len() - start)?);
        self.faces.push(face.index);
        Ok(())
    }
}

/// True when a point comes twice.
fn has_twice(corners: &[(u32, u32)], seen: &mut FxHashSet<u32>) -> bool {
    if corners.len() <= 8 {
        return corners.iter().enumerate().any(|(k, (point, _))| corners.iter().skip(k + 1).any(|(p, _)| p == point));
    }
    seen.clear();
    !corners.iter().all(|(point, _)| seen.insert(*point))
}

/// True when each corner turns the way that the face does.
fn is_convex(places: &[DVec3], normal: DVec3) -> bool {
    let ahead = |k: usize| places[(k + 1) % places.len()] - places[k];
    (0..places.len()).all(|k| ahead(k).cross(ahead((k + 1) % places.len())).dot(normal) > 0.0)
}

fn int(count: usize) -> Result<i32, Error> {
    i32::try_from(count).map_err(|_too_large| Error::Invalid("more than can be numbered"))
}
