// SPDX-License-Identifier: Apache-2.0
//! A wall that fills the picture, under a dome, by materials of different cost: each path meets it once, so what a
//! material costs is a difference of times over the number of paths.

use anyhow::{Context as _, Result, ensure};
use glam::DVec3;
use oocpt_core::camera::Camera;
use oocpt_core::material::{MaterialText, describe};
use oocpt_core::scene::{
    AssetRef, ConnectionDesc, LightDesc, LightKind, MaterialDesc, NodeDesc, ParamDesc, ParamValue, SceneDb,
};

use super::forest::{self, grid, prim};
use super::preview::dress;

/// Quads along a side of the wall.
const QUADS: u32 = 64;
/// Half the side of the wall, scene units.
const HALF_SIDE: f64 = 12.0;
/// Where the camera is.
const DISTANCE: f64 = 4.0;

/// What the wall is made of: `open_pbr_surface` by networks of `MaterialX` nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pattern {
    /// Constants.
    Constant,
    /// Two textures, of colour and roughness, which need no program.
    Textured,
    /// Ten nodes, of these two of noise.
    Short,
    /// Sixty nodes, of these two of `fractal3d`, two of `noise3d`, four of `cellnoise3d`.
    Long,
}

impl Pattern {
    /// All, in the order of the documentation.
    pub const ALL: [Self; 4] = [Self::Constant, Self::Textured, Self::Short, Self::Long];

    /// The name in options and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Constant => "constant",
            Self::Textured => "textured",
            Self::Short => "10 nodes",
            Self::Long => "60 nodes",
        }
    }

    /// The network; side of its textures in texels.
    pub fn network(self, texture_size: u32) -> MaterialDesc {
        let mut network = Network::default();
        let surface = network.add("open_pbr_surface_surfaceshader", &[("base_weight", ParamValue::Float(1.0))], &[]);
        let (color, roughness) = match self {
            Self::Constant => (None, None),
            Self::Textured => network.textured(texture_size.max(2)),
            Self::Short => network.short(),
            Self::Long => network.long(),
        };
        for (input, from) in [("base_color", color), ("specular_roughness", roughness)] {
            network.connect(surface, input, from);
        }
        MaterialDesc {
            path: "/material".into(),
            nodes: network.nodes,
            surface: Some(surface),
            ..MaterialDesc::default()
        }
    }
}

/// Nodes as they are added.
#[derive(Default)]
struct Network {
    nodes: Vec<NodeDesc>,
}

impl Network {
    fn add(&mut self, kind: &str, params: &[(&str, ParamValue)], from: &[(&str, usize)]) -> usize {
        let at = self.nodes.len();
        let param = |(name, value): &(&str, ParamValue)| ParamDesc { name: (*name).into(), value: value.clone() };
        self.nodes.push(NodeDesc {
            path: format!("/material/{kind}_{at}").into(),
            kind: format!("ND_{kind}").into(),
            params: params.iter().map(param).collect(),
            connections: Vec::new(),
        });
        for (input, from) in from {
            self.connect(at, input, Some(*from));
        }
        at
    }

    fn connect(&mut self, at: usize, input: &str, from: Option<usize>) {
        if let (Some(node), Some(from)) = (self.nodes.get_mut(at), from) {
            node.connections.push(ConnectionDesc { input: input.into(), node: from, output: "out".into() });
        }
    }

    fn textured(&mut self, side: u32) -> (Option<usize>, Option<usize>) {
        let file = |kind: &str| {
            let name = format!("{kind}:{side}:1");
            ParamValue::Asset(AssetRef { authored: name.as_str().into(), resolved: name.as_str().into() })
        };
        let color = self.add("image_color3", &[("file", file("bark"))], &[]);
        let numbers = self.add("image_color3", &[("file", file("surface"))], &[]);
        let roughness = self.add("extract_color3", &[("index", ParamValue::Int(1))], &[("in", numbers)]);
        (Some(color), Some(roughness))
    }

    fn short(&mut self) -> (Option<usize>, Option<usize>) {
        use ParamValue::{Float, Vec3};
        let place = self.add("texcoord_vector2", &[], &[]);
        let place = self.add("multiply_vector2FA", &[("in2", Float(6.0))], &[("in1", place)]);
        let half = [("amplitude", Float(0.5)), ("pivot", Float(0.5))];
        let noise = self.add("noise2d_float", &half, &[("texcoord", place)]);
        let cells = self.add("cellnoise2d_float", &[], &[("texcoord", place)]);
        let edge = [("low", Float(0.2)), ("high", Float(0.8))];
        let soft = self.add("smoothstep_float", &edge, &[("in", noise)]);
        let share = self.add("mix_float", &[("mix", Float(0.3))], &[("fg", cells), ("bg", soft)]);
        let colors = [("fg", Vec3([0.8, 0.5, 0.2])), ("bg", Vec3([0.1, 0.2, 0.4]))];
        let color = self.add("mix_color3", &colors, &[("mix", share)]);
        let color = self.add("power_color3FA", &[("in2", Float(1.2))], &[("in1", color)]);
        let roughness = self.add("multiply_float", &[("in2", Float(0.5))], &[("in1", share)]);
        let roughness = self.add("add_float", &[("in2", Float(0.2))], &[("in1", roughness)]);
        (Some(color), Some(roughness))
    }

    fn long(&mut self) -> (Option<usize>, Option<usize>) {
        use ParamValue::{Float, Int, Vec3};
        let place = self.add("position_vector3", &[], &[]);
        let place = self.add("multiply_vector3FA", &[("in2", Float(5.0))], &[("in1", place)]);
        let mut sum = None;
        for layer in 0..8_u8 {
            let k = f32::from(layer);
            let moved = self.add("add_vector3FA", &[("in2", Float(0.37 + 1.7 * k))], &[("in1", place)]);
            let at = [("position", moved)];
            let noise = match layer % 4 {
                0 => self.add("fractal3d_float", &[("octaves", Int(3))], &at),
                2 => self.add("noise3d_float", &[], &at),
                _ => self.add("cellnoise3d_float", &[], &at),
            };
            let scaled = self.add("multiply_float", &[("in2", Float(0.6 + 0.1 * k))], &[("in1", noise)]);
            let edge = [("low", Float(-0.4)), ("high", Float(0.7))];
            let soft = self.add("smoothstep_float", &edge, &[("in", scaled)]);
            let wave = self.add("sin_float", &[], &[("in", soft)]);
            let colors = [("fg", Vec3([0.9, 0.1 * k, 0.3])), ("bg", Vec3([0.1, 0.5, 0.08 * k]))];
            let color = self.add("mix_color3", &colors, &[("mix", wave)]);
            let below: Vec<(&str, usize)> = [("fg", color)].into_iter().chain(sum.map(|sum| ("bg", sum))).collect();
            sum = Some(self.add("mix_color3", &[("mix", Float(0.4))], &below));
        }
        let from: Vec<(&str, usize)> = sum.map(|sum| ("in", sum)).into_iter().collect();
        let grey = self.add("luminance_color3", &[], &from);
        let roughness = self.add("extract_color3", &[("index", Int(0))], &[("in", grey)]);
        (sum, Some(roughness))
    }
}

/// Fills `db`; tells what the material is.
pub fn build(db: &mut SceneDb, pattern: Pattern, texture_size: u32) -> Result<MaterialText> {
    let material = pattern.network(texture_size);
    let text = describe(&material);
    let first = text.warnings.first().map(String::as_str).unwrap_or_default();
    ensure!(text.is_understood && text.warnings.is_empty(), "the material of {}: {first}", pattern.name());
    let st = (0..=QUADS).flat_map(|row| (0..=QUADS).map(move |column| [column, row]));
    #[expect(clippy::cast_precision_loss, reason = "few quads")]
    let st = st.map(|at| at.map(|k| 8.0 * k as f32 / QUADS as f32)).collect();
    let wall = grid("/wall", QUADS, QUADS, |u, v| HALF_SIDE * DVec3::new(2.0 * u - 1.0, 2.0 * v - 1.0, 0.0))?;
    db.upsert_material(material);
    db.upsert_mesh(dress(wall, st, "/material").context("the wall")?);
    db.upsert_light(LightDesc {
        prim: prim("/dome", Vec::new()),
        kind: LightKind::PLAIN_DOME,
        color: [1.0; 3],
        intensity: 1.0,
        exposure: 0.0,
        camera_visible: true,
        ..LightDesc::default()
    });
    Ok(text)
}

/// A camera that sees nothing but the wall, up to pictures nine times as wide as high.
pub fn camera(width: u32, height: u32) -> Camera {
    forest::view(DVec3::new(0.0, 0.0, DISTANCE), DVec3::ZERO, width, height)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bench_materials_match_their_names() {
        let told = Pattern::ALL.map(|pattern| {
            let mut db = SceneDb::new();
            build(&mut db, pattern, 64).expect("MaterialX's data libraries are there")
        });
        // The surface is one more.
        assert_eq!(told.each_ref().map(|text| text.nodes.len() - 1), [0, 3, 10, 60]);
        assert_eq!(told.each_ref().map(|text| text.lookups), [0, 2, 0, 0]);
        let instructions = told.each_ref().map(|text| text.program.instructions.len());
        assert!(instructions[..2] == [0, 0] && instructions[2] >= 10 && instructions[3] >= 55, "{instructions:?}");
        assert_eq!(told.each_ref().map(|text| text.program.noises), [0, 0, 2, 8]);
        let fractals = told[3].program.instructions.iter().filter(|line| line.contains("fractal3")).count();
        assert_eq!(fractals, 2);
    }

    /// The view's corners are on the wall, so every path meets it.
    #[test]
    fn the_wall_fills_the_picture() {
        let Camera { world_from_view, projection, .. } = camera(900, 100);
        for corner in [[-1.0, -1.0], [1.0, 1.0]] {
            let view = projection.inverse().project_point3(DVec3::new(corner[0], corner[1], 0.0));
            let (eye, point) = (world_from_view.w_axis.truncate(), world_from_view.transform_point3(view));
            let along = point - eye;
            let hit = eye - along * (eye.z / along.z);
            assert!(along.z < 0.0 && hit.x.abs() < HALF_SIDE && hit.y.abs() < HALF_SIDE, "{hit}");
        }
    }
}
