// SPDX-License-Identifier: Apache-2.0
//! Compiles the nodes `UsdUVTexture`, `HwPtexTexture_1` and `UsdTransform2d`.

use super::compiler::NetworkCompiler;
use super::params::{NumberShape, asset, connection, numbers, param, text};
use super::reader::READER;
use super::{InputValue, MAX_UV_SETS, PTEX_SET, TextureRef, UvSet, Wrap};
use crate::desc::{NodeDesc, ParamValue};
use oocpt_abi::NAME_PTEX;
use std::sync::Arc;

/// Storm's node for Ptex; `UsdUVTexture` reads Ptex, too, from files that end in `.ptx`.
const PTEX_NODE: &str = "HwPtexTexture_1";

/// True if a node reads a texture.
pub(super) fn is_texture(node: &NodeDesc) -> bool {
    matches!(&*node.kind, "UsdUVTexture" | PTEX_NODE)
}

/// True if a resolved name is that of a Ptex file, alone or in a package (`a.usdz[b.ptx]`).
#[must_use]
pub fn is_ptex_name(resolved: &str) -> bool {
    let name = resolved.trim_end_matches(']').as_bytes();
    name.last_chunk::<4>().is_some_and(|end| end.eq_ignore_ascii_case(b".ptx"))
}

/// Longest chain of `UsdTransform2d` nodes; a longer one counts as a cycle.
const MAX_TRANSFORMS: usize = 16;
/// A 2 x 3 affine map of texture coordinates, by rows.
type UvTransform = [[f32; 3]; 2];

/// `fallback` of the specification of `UsdUVTexture`: black and opaque.
const FALLBACK: [f32; 4] = [0.0, 0.0, 0.0, 1.0];
const IDENTITY: UvTransform = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

impl<'a> NetworkCompiler<'a> {
    /// Compiles the output `output` of a texture node.
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
        let constant = channel.and_then(|c| fallback.get(usize::from(c))).map_or(fallback, |v| [*v; 4]);
        let Some(asset) = asset(node, "file", &mut self.problems).filter(|a| !a.resolved.is_empty()) else {
            self.report_missing_file(node);
            return Some(InputValue::Constant(constant));
        };
        let wrap = [self.wrap(node, "wrapS"), self.wrap(node, "wrapT")];
        let color_space = self.color_space(node);
        let is_ptex = &*node.kind == PTEX_NODE || is_ptex_name(&asset.resolved);
        let (uv, transform) = if is_ptex { self.ptex_coordinates(node) } else { self.coordinates(node) };
        if is_ptex && uv.is_none() {
            return Some(InputValue::Constant(constant));
        }
        let prim = Arc::clone(&node.path);
        let reference = TextureRef { prim, asset, wrap, color_space, fallback, has_border: false, is_ptex };
        let existing = self.textures.iter().position(|texture| *texture == reference);
        let texture = existing.unwrap_or(self.textures.len());
        if existing.is_none() {
            self.textures.push(reference);
        }
        Some(InputValue::Texture { texture: u32::try_from(texture).ok()?, channel, scale, bias, uv, transform })
    }

    fn report_missing_file(&mut self, node: &NodeDesc) {
        self.problems.add(match param(node, "file") {
            Some(ParamValue::Asset(asset)) => format!("the texture {} of {} was not found", asset.authored, node.path),
            Some(_) => format!("the texture of {} was not found", node.path),
            None => format!("{} has no file", node.path),
        });
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

    /// The UV set of Ptex, whose coordinates come from the topology: a connection of `st` is ignored. None if there are
    /// too many sets.
    fn ptex_coordinates(&mut self, node: &'a NodeDesc) -> (Option<u8>, UvTransform) {
        let existing = self.uv_sets.iter().position(|set| &*set.name == PTEX_SET);
        let set = existing.unwrap_or(self.uv_sets.len());
        if set >= MAX_UV_SETS {
            self.problems
                .add(format!("more than {MAX_UV_SETS} sets of texture coordinates: the Ptex of {}", node.path));
            return (None, IDENTITY);
        }
        if existing.is_none() {
            self.uv_sets.push(UvSet { name: PTEX_SET.into(), id: NAME_PTEX, fallback: [0.0; 2] });
        }
        (u8::try_from(set).ok(), IDENTITY)
    }

    /// The UV set that a texture node reads, and the transform of its coordinates. Without a set the transform maps
    /// every point to the one that is looked up.
    fn coordinates(&mut self, node: &'a NodeDesc) -> (Option<u8>, UvTransform) {
        let (mut at, mut name, mut transform) = (node, "st", IDENTITY);
        for _ in 0..=MAX_TRANSFORMS {
            let Some(source) = connection(at, name) else {
                let [s, t, ..] = numbers(at, name, NumberShape::Pair, [0.0; 4], &mut self.problems);
                return (None, constant_map(&transform, [s, t]));
            };
            let Some(next) = self.nodes.get(source.node) else {
                self.problems.add(format!("`{name}` of {} is connected to nothing", at.path));
                return (None, constant_map(&transform, [0.0; 2]));
            };
            if &*next.kind == "UsdTransform2d" {
                transform = compose(&transform, &self.transform(next));
                (at, name) = (next, "in");
            } else if next.kind.strip_prefix(READER) == Some("float2") {
                return match self.coordinate_reader(next) {
                    Ok(set) => (Some(set), finite_or_identity(transform)),
                    Err(fallback) => (None, constant_map(&transform, fallback)),
                };
            } else {
                self.unsupported(next);
                return (None, constant_map(&transform, [0.0; 2]));
            }
        }
        self.problems.add(format!("`st` of {} goes through too many nodes, or in a circle", node.path));
        (None, constant_map(&transform, [0.0; 2]))
    }

    /// The transform of a `UsdTransform2d`: scale, then rotation (degrees, counter-clockwise), then translation.
    fn transform(&mut self, node: &'a NodeDesc) -> UvTransform {
        let [sx, sy, ..] = numbers(node, "scale", NumberShape::Pair, [1.0; 4], &mut self.problems);
        let [angle, ..] = numbers(node, "rotation", NumberShape::Scalar, [0.0; 4], &mut self.problems);
        let [tx, ty, ..] = numbers(node, "translation", NumberShape::Pair, [0.0; 4], &mut self.problems);
        let (sin, cos) = sin_cos_degrees(angle);
        [[cos * sx, -sin * sy, tx], [sin * sx, cos * sy, ty]]
    }
}

/// Sine and cosine, exact for multiples of 90 degrees, so that textures turned by those keep their texels.
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

/// The transform that applies `b`, then `a`.
fn compose(a: &UvTransform, b: &UvTransform) -> UvTransform {
    a.map(|[x, y, offset]| {
        let entry = |k: usize| x * b[0][k] + y * b[1][k];
        [entry(0), entry(1), entry(2) + offset]
    })
}

/// The transform that maps every point to where `transform` maps this one.
fn constant_map(transform: &UvTransform, [s, t]: [f32; 2]) -> UvTransform {
    finite_or_identity(transform.map(|[x, y, offset]| [0.0, 0.0, x * s + y * t + offset]))
}

/// Replaces a transform whose composition has overflowed.
fn finite_or_identity(transform: UvTransform) -> UvTransform {
    if transform.as_flattened().iter().all(|v| v.is_finite()) { transform } else { IDENTITY }
}
