// SPDX-License-Identifier: Apache-2.0
//! Scenes of the cases: bodies that go to the renderer as meshes, and to the f64 tracer as triangles.

use glam::{DAffine3, DMat3, DMat4, DVec3};
use oocpt_core::TypedArray;
use oocpt_core::scene::{
    ConnectionDesc, InstancedBy, Interpolation, LightDesc, LightKind, MaterialDesc, MeshDesc, NodeDesc, ParamDesc,
    ParamValue, PrimDesc, Primvar, SceneDb,
};

use crate::tracer::{Sun, Tracer};

/// A polygon mesh of one albedo, in f32 as a scene file has it.
#[derive(Clone, Debug)]
pub(crate) struct Body {
    pub(crate) points: Vec<[f32; 3]>,
    pub(crate) faces: Vec<Vec<i32>>,
    pub(crate) albedo: f32,
}

/// A body and where it is.
#[derive(Clone, Debug)]
pub(crate) struct Placed {
    pub(crate) body: Body,
    pub(crate) place: DMat4,
}

/// Bodies in the world, a dome, a sun.
#[derive(Clone, Debug, Default)]
pub(crate) struct World {
    pub(crate) bodies: Vec<Placed>,
    pub(crate) dome: f32,
    pub(crate) sun: Option<SunLight>,
}

/// A distant light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SunLight {
    /// Towards the light.
    pub(crate) direction: DVec3,
    pub(crate) irradiance: f32,
    /// Full angle.
    pub(crate) degrees: f32,
}

#[expect(clippy::cast_possible_truncation, reason = "a scene file's precision")]
pub(crate) fn narrow(v: DVec3) -> [f32; 3] {
    [v.x as f32, v.y as f32, v.z as f32]
}

pub(crate) fn wide(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

impl Body {
    /// A square of two units in y = 0, facing up.
    pub(crate) fn square(albedo: f32) -> Self {
        let points = vec![[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 0.0, -1.0]];
        Self { points, faces: vec![vec![0, 1, 2, 3]], albedo }
    }

    /// A box of two units.
    pub(crate) fn cube(albedo: f32) -> Self {
        let corner = |i: u8| [0, 1, 2].map(|k| if i >> k & 1 == 1 { 1.0 } else { -1.0 });
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        Self { points: (0..8).map(corner).collect(), faces: faces.map(Vec::from).to_vec(), albedo }
    }

    /// A closed sphere of radius 1 about y: `rings` x `2 rings` cells.
    pub(crate) fn sphere(rings: i32, albedo: f32) -> Self {
        let columns = 2 * rings;
        let mut points = vec![DVec3::Y];
        for ring in 1..rings {
            let phi = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
            for column in 0..columns {
                let theta = std::f64::consts::TAU * f64::from(column) / f64::from(columns);
                points.push(DVec3::new(phi.sin() * theta.cos(), phi.cos(), -phi.sin() * theta.sin()));
            }
        }
        points.push(DVec3::NEG_Y);
        let last = 1 + (rings - 1) * columns;
        let at = |ring: i32, column: i32| 1 + (ring - 1) * columns + column % columns;
        let mut faces = Vec::new();
        for column in 0..columns {
            faces.push(vec![0, at(1, column), at(1, column + 1)]);
            for ring in 1..rings - 1 {
                let (a, b) = (at(ring, column), at(ring + 1, column));
                faces.push(vec![a, b, at(ring + 1, column + 1), at(ring, column + 1)]);
            }
            faces.push(vec![at(rings - 1, column), last, at(rings - 1, column + 1)]);
        }
        // Quads of a sphere are planar but for rounding; triangles leave no choice of a diagonal.
        let triangles = faces.into_iter().flat_map(|f| match f[..] {
            [a, b, c, d] => vec![vec![a, b, c], vec![a, c, d]],
            _ => vec![f],
        });
        Self { points: points.into_iter().map(narrow).collect(), faces: triangles.collect(), albedo }
    }

    /// The same with its points moved.
    pub(crate) fn moved(mut self, to: impl Fn(DVec3) -> DVec3) -> Self {
        for p in &mut self.points {
            *p = narrow(to(wide(*p)));
        }
        self
    }

    /// As the renderer takes it.
    pub(crate) fn mesh(&self, prim: PrimDesc, prim_id: i32) -> MeshDesc {
        let count = |face: &Vec<i32>| i32::try_from(face.len()).unwrap_or(0);
        let albedo = TypedArray::of(vec![[self.albedo; 3]]);
        MeshDesc {
            prim,
            prim_id,
            double_sided: true,
            face_vertex_counts: TypedArray::of(self.faces.iter().map(count).collect::<Vec<i32>>()),
            face_vertex_indices: TypedArray::of(self.faces.concat()),
            points: TypedArray::of(self.points.clone()),
            display_color: Some(Primvar { interpolation: Interpolation::Constant, values: albedo, indices: None }),
            ..MeshDesc::default()
        }
    }

    /// Its triangles under a map, in f64.
    pub(crate) fn triangles(&self, place: &DMat4) -> Vec<([DVec3; 3], f64)> {
        let map = DAffine3::from_mat4(*place);
        let at =
            |i: i32| self.points.get(usize::try_from(i).unwrap_or(usize::MAX)).map(|p| map.transform_point3(wide(*p)));
        let mut triangles = Vec::new();
        for face in &self.faces {
            for k in 1..face.len().saturating_sub(1) {
                if let (Some(a), Some(b), Some(c)) = (at(face[0]), at(face[k]), at(face[k + 1])) {
                    triangles.push(([a, b, c], f64::from(self.albedo)));
                }
            }
        }
        triangles
    }
}

impl World {
    /// The scene for the renderer; prim ids count from 0.
    pub(crate) fn author(&self, db: &mut SceneDb) {
        for (id, placed) in (0..).zip(&self.bodies) {
            db.upsert_mesh(placed.body.mesh(prim(&format!("/body_{id}"), placed.place), id));
        }
        if self.dome > 0.0 {
            db.upsert_light(dome(self.dome));
        }
        if let Some(sun) = self.sun {
            db.upsert_light(sun.light());
        }
    }

    /// The scene for the f64 tracer.
    pub(crate) fn tracer(&self) -> Tracer {
        let triangles = self.bodies.iter().flat_map(|placed| placed.body.triangles(&placed.place)).collect();
        let mut tracer = Tracer::new(triangles);
        self.light(&mut tracer);
        tracer
    }

    /// Gives its lights to a tracer.
    pub(crate) fn light(&self, tracer: &mut Tracer) {
        tracer.dome = f64::from(self.dome);
        tracer.suns = self.sun.iter().map(SunLight::reference).collect();
    }

    /// Everything under another map.
    pub(crate) fn mapped(&self, map: &DMat4) -> Self {
        let bodies = self.bodies.iter().map(|p| Placed { body: p.body.clone(), place: *map * p.place }).collect();
        Self { bodies, ..self.clone() }
    }
}

impl SunLight {
    fn light(&self) -> LightDesc {
        let z = self.direction.normalize();
        let (x, y) = z.any_orthonormal_pair();
        let transform = DMat4::from_mat3(DMat3::from_cols(x, y, z));
        LightDesc {
            prim: prim("/sun", transform),
            kind: LightKind::Distant { angle_degrees: self.degrees },
            intensity: self.irradiance,
            normalize: true,
            ..LightDesc::default()
        }
    }

    fn reference(&self) -> Sun {
        let half = 0.5 * f64::from(self.degrees).to_radians();
        let one_minus_cos = 2.0 * (0.5 * half).sin().powi(2);
        Sun { direction: self.direction.normalize(), irradiance: f64::from(self.irradiance), one_minus_cos }
    }
}

/// A prim with a place.
pub(crate) fn prim(path: &str, transform: DMat4) -> PrimDesc {
    PrimDesc { path: path.into(), transform, ..PrimDesc::default() }
}

/// The same as the prototype of an instancer.
pub(crate) fn instanced(mut prim: PrimDesc, instancer: &str) -> PrimDesc {
    let prototype_root = prim.path.clone();
    prim.instanced_by = vec![InstancedBy { instancer: instancer.into(), prototype_root }];
    prim
}

/// A constant dome.
pub(crate) fn dome(radiance: f32) -> LightDesc {
    LightDesc { prim: prim("/dome", DMat4::IDENTITY), intensity: radiance, ..LightDesc::default() }
}

/// A node: its values, and by which output of which node of the network its inputs are fed.
pub(crate) fn node(kind: &str, values: &[(&str, ParamValue)], inputs: &[(&str, usize, &str)]) -> NodeDesc {
    let params = values.iter().map(|(name, value)| ParamDesc { name: (*name).into(), value: value.clone() }).collect();
    let connections = inputs.iter().map(|(input, node, output)| ConnectionDesc {
        input: (*input).into(),
        node: *node,
        output: (*output).into(),
    });
    NodeDesc { path: format!("/{kind}").into(), kind: kind.into(), params, connections: connections.collect() }
}

/// A material of a network whose first node is the surface.
pub(crate) fn network(path: &str, nodes: Vec<NodeDesc>) -> MaterialDesc {
    MaterialDesc { path: path.into(), nodes, surface: Some(0), ..MaterialDesc::default() }
}

/// A `UsdPreviewSurface`.
pub(crate) fn material(path: &str, values: &[(&str, ParamValue)]) -> MaterialDesc {
    network(path, vec![node("UsdPreviewSurface", values, &[])])
}
