// SPDX-License-Identifier: Apache-2.0
//! `UsdUVTexture`, `HwPtexTexture_1` and `UsdTransform2d`. Pure.

use super::compile::NetworkCompiler;
use super::params::{NumberShape, asset, connection, numbers, param, text};
use super::reader::READER;
use super::{InputValue, MAX_UV_SETS, PTEX_SET, TextureRef, UvSet, Wrap};
use crate::desc::{NodeDesc, ParamValue};
use oocpt_abi::NAME_PTEX;
use std::sync::Arc;

/// Storm's node for Ptex; `UsdUVTexture` reads Ptex, too, from files that end in `.ptx`.
const PTEX_NODE: &str = "HwPtexTexture_1";

/// Whether a node is a texture.
pub(super) fn is_texture(node: &NodeDesc) -> bool {
    matches!(&*node.kind, "UsdUVTexture" | PTEX_NODE)
}

/// Whether a file is Ptex by its resolved name, which may be that of a file in a package.
#[must_use]
pub fn is_ptex_name(resolved: &str) -> bool {
    let name = resolved.trim_end_matches(']').as_bytes();
    name.last_chunk::<4>().is_some_and(|end| end.eq_ignore_ascii_case(b".ptx"))
}

/// Most `UsdTransform2d` in a row.
const MAX_TRANSFORMS: usize = 16;
/// Black and opaque.
const FALLBACK: [f32; 4] = [0.0, 0.0, 0.0, 1.0];
const IDENTITY: [[f32; 3]; 2] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

impl<'a> NetworkCompiler<'a> {
    /// The output `output` of a texture node.
    pub(super) fn texture(&mut self, node: &'a NodeDesc, output: &str) -> Option<InputValue> {
        let channel = match output {
            "r" => Some(0),
            "g" => Some(1),
            "b" => Some(2),
            "a" => Some(3),
            "rgb" | "rgba" => None,
            _ => {
                self.problems.add(format!("{} has no output `{output}`", node.path));
                return None;
            }
        };
        for name in ["file", "scale", "bias", "fallback", "wrapS", "wrapT", "sourceColorSpace"] {
            if connection(node, name).is_some() {
                self.problems.add(format!("`{name}` of {} is connected, which is not supported", node.path));
            }
        }
        let scale = numbers(node, "scale", NumberShape::Four, [1.0; 4], &mut self.problems);
        let bias = numbers(node, "bias", NumberShape::Four, [0.0; 4], &mut self.problems);
        let fallback = numbers(node, "fallback", NumberShape::Four, FALLBACK, &mut self.problems);
        let picked = |v: [f32; 4]| channel.and_then(|c| v.get(usize::from(c))).map_or(v, |v| [*v; 4]);
        let Some(asset) = asset(node, "file", &mut self.problems).filter(|a| !a.resolved.is_empty()) else {
            match param(node, "file") {
                Some(ParamValue::Asset(asset)) => {
                    self.problems.add(format!("the texture {} of {} was not found", asset.authored, node.path));
                }
                Some(_) => self.problems.add(format!("the texture of {} was not found", node.path)),
                None => self.problems.add(format!("{} has no file", node.path)),
            }
            return Some(InputValue::Constant(picked(fallback)));
        };
        let wrap = [self.wrap(node, "wrapS"), self.wrap(node, "wrapT")];
        let color_space = self.color_space(node);
        let is_ptex = &*node.kind == PTEX_NODE || is_ptex_name(&asset.resolved);
        let (uv, transform) = if is_ptex { self.ptex_coordinates(node) } else { self.coordinates(node) };
        if is_ptex && uv.is_none() {
            return Some(InputValue::Constant(picked(fallback)));
        }
        let prim = Arc::clone(&node.path);
        let reference = TextureRef { prim, asset, wrap, color_space, fallback, has_border: false, is_ptex };
        let known = self.textures.iter().position(|texture| *texture == reference);
        let texture = known.unwrap_or(self.textures.len());
        if known.is_none() {
            self.textures.push(reference);
        }
        Some(InputValue::Texture { texture: u32::try_from(texture).ok()?, channel, scale, bias, uv, transform })
    }

    fn wrap(&mut self, node: &'a NodeDesc, name: &str) -> Wrap {
        match text(node, name, &mut self.problems) {
            None | Some("useMetadata") => Wrap::UseMetadata,
            Some("black") => Wrap::Black,
            Some("clamp") => Wrap::Clamp,
            Some("repeat") => Wrap::Repeat,
            Some("mirror") => Wrap::Mirror,
            Some(other) => {
                self.problems.add(format!("`{name}` of {} cannot be `{other}`", node.path));
                Wrap::UseMetadata
            }
        }
    }

    /// The set of Ptex coordinates. They come from the topology: what `st` is connected to does not count.
    fn ptex_coordinates(&mut self, node: &'a NodeDesc) -> (Option<u8>, [[f32; 3]; 2]) {
        let known = self.uv_sets.iter().position(|set| &*set.name == PTEX_SET);
        let set = known.unwrap_or(self.uv_sets.len());
        if set >= MAX_UV_SETS {
            self.problems
                .add(format!("more than {MAX_UV_SETS} sets of texture coordinates: the Ptex of {}", node.path));
            return (None, IDENTITY);
        }
        if known.is_none() {
            self.uv_sets.push(UvSet { name: PTEX_SET.into(), id: NAME_PTEX, fallback: [0.0; 2] });
        }
        (u8::try_from(set).ok(), IDENTITY)
    }

    /// Where a texture node looks: the set, and the map from it.
    fn coordinates(&mut self, node: &'a NodeDesc) -> (Option<u8>, [[f32; 3]; 2]) {
        let (mut at, mut name, mut map) = (node, "st", IDENTITY);
        for _ in 0..=MAX_TRANSFORMS {
            let Some(source) = connection(at, name) else {
                let [s, t, ..] = numbers(at, name, NumberShape::Pair, [0.0; 4], &mut self.problems);
                return (None, place(&map, [s, t]));
            };
            let Some(next) = self.nodes.get(source.node) else {
                self.problems.add(format!("`{name}` of {} is connected to nothing", at.path));
                return (None, place(&map, [0.0; 2]));
            };
            if &*next.kind == "UsdTransform2d" {
                map = compose(&map, &self.transform(next));
                (at, name) = (next, "in");
            } else if next.kind.strip_prefix(READER) == Some("float2") {
                return match self.coordinate_reader(next) {
                    Ok(set) => (Some(set), finite(map)),
                    Err(fallback) => (None, place(&map, fallback)),
                };
            } else {
                self.unsupported(next);
                return (None, place(&map, [0.0; 2]));
            }
        }
        self.problems.add(format!("`st` of {} goes through too many nodes, or in a circle", node.path));
        (None, place(&map, [0.0; 2]))
    }

    /// Scale, then rotation (degrees, counter-clockwise), then translation.
    fn transform(&mut self, node: &'a NodeDesc) -> [[f32; 3]; 2] {
        let [sx, sy, ..] = numbers(node, "scale", NumberShape::Pair, [1.0; 4], &mut self.problems);
        let [angle, ..] = numbers(node, "rotation", NumberShape::Scalar, [0.0; 4], &mut self.problems);
        let [tx, ty, ..] = numbers(node, "translation", NumberShape::Pair, [0.0; 4], &mut self.problems);
        let (sin, cos) = sin_cos_degrees(angle);
        [[cos * sx, -sin * sy, tx], [sin * sx, cos * sy, ty]]
    }
}

/// Exact for whole quarter turns.
#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
fn sin_cos_degrees(degrees: f32) -> (f32, f32) {
    let turns = f64::from(degrees) % 360.0;
    if turns % 90.0 == 0.0 {
        return match turns.rem_euclid(360.0) {
            90.0 => (1.0, 0.0),
            180.0 => (0.0, -1.0),
            270.0 => (-1.0, 0.0),
            _ => (0.0, 1.0),
        };
    }
    let (sin, cos) = turns.to_radians().sin_cos();
    (sin as f32, cos as f32)
}

/// `a` after `b`.
fn compose(a: &[[f32; 3]; 2], b: &[[f32; 3]; 2]) -> [[f32; 3]; 2] {
    a.map(|[x, y, offset]| {
        let column = |k: usize| x * b[0][k] + y * b[1][k];
        [column(0), column(1), column(2) + offset]
    })
}

/// The map that gives the image of one point everywhere.
fn place(map: &[[f32; 3]; 2], [s, t]: [f32; 2]) -> [[f32; 3]; 2] {
    finite(map.map(|[x, y, offset]| [0.0, 0.0, x * s + y * t + offset]))
}

/// Products of finite numbers may overflow.
fn finite(map: [[f32; 3]; 2]) -> [[f32; 3]; 2] {
    if map.as_flattened().iter().all(|v| v.is_finite()) { map } else { IDENTITY }
}
