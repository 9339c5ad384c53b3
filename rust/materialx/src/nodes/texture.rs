// SPDX-License-Identifier: Apache-2.0
//! Texture nodes: `image` (which `tiledimage` and others are graphs of), `UsdUVTexture`.

use std::sync::Arc;

use crate::expression::Val;
use crate::program::Op;
use crate::uses::{AddressMode, MaterialTexture};
use crate::value::{FileRef, PortType};
use crate::walk::{BoundValue, NetworkWalker, NodeAddress};

impl NetworkWalker<'_> {
    pub(super) fn texture_node(
        &mut self,
        at: NodeAddress,
        category: &str,
        ty: PortType,
        output: &Arc<str>,
    ) -> Option<Val> {
        match category {
            "image" => self.image(at, ty),
            "UsdUVTexture" => self.uv_texture(at, output),
            // Filters over a neighbourhood have no other place than their own.
            "blur" => {
                self.left_out(at, "is not blurred");
                Some(self.number_or(at, "in", 0.0))
            }
            "heighttonormal" => Some(self.height_to_normal(at)),
            "bump" => Some(self.bump(at)),
            _ => None,
        }
    }

    fn left_out(&mut self, at: NodeAddress, what: &str) {
        let (category, path) = (self.category(at), self.path(at));
        self.problem(format!("`{category}` ({path}) {what}"));
    }

    /// The file that an input names; a problem where there is none.
    fn file(&mut self, at: NodeAddress) -> Option<FileRef> {
        let found = match self.input(at, "file") {
            Some(BoundValue::File(file)) => Some(file),
            Some(BoundValue::Text(text)) if !text.is_empty() => {
                Some(FileRef { resolved: Arc::clone(&text), authored: text, color_space: None, node: self.path(at) })
            }
            _ => None,
        };
        match found {
            // Of a file that a definition names.
            Some(file) if !file.resolved.is_empty() && file.node.is_empty() => {
                Some(FileRef { node: self.path(at), ..file })
            }
            Some(file) if !file.resolved.is_empty() => Some(file),
            Some(file) => {
                self.problem(format!("the texture {} of {} was not found", file.authored, file.node));
                None
            }
            None => {
                let path = self.path(at);
                self.problem(format!("{path} has no file"));
                None
            }
        }
    }

    fn image(&mut self, at: NodeAddress, ty: PortType) -> Option<Val> {
        let fallback = self.number_or(at, "default", 0.0);
        let Some(file) = self.file(at) else { return Some(fallback) };
        let place = self.number_or(at, "texcoord", 0.0);
        let address = ["uaddressmode", "vaddressmode"].map(|name| match self.text(at, name).as_deref() {
            Some("constant") => AddressMode::Constant,
            Some("clamp") => AddressMode::Clamp,
            Some("mirror") => AddressMode::Mirror,
            _ => AddressMode::Periodic,
        });
        let mut constant = fallback.constant().unwrap_or_default();
        if ty.width() < 4 {
            constant[3] = 1.0;
        }
        let texture = MaterialTexture { file, address, fallback: constant, has_border: true, auto_color_space: false };
        let Some(lookup) = self.uses.lookup(&texture, place) else {
            self.problem("too many texture lookups".to_owned());
            return Some(fallback);
        };
        let texel = self.expressions.op(Op::Texture, [place, Val::ZERO, Val::ZERO], lookup);
        let texel = if ty == PortType::Float { self.expressions.component(texel, 0) } else { texel };
        if fallback.constant().is_some() {
            return Some(texel);
        }
        // What other nodes work out cannot lie around the image.
        let constant = address.map(|mode| mode == AddressMode::Constant);
        let is_outside = self.is_outside(place, constant);
        Some(self.expressions.op(Op::Select, [fallback, texel, is_outside], 0))
    }

    /// Whether a place is outside the unit square along one of these axes.
    fn is_outside(&mut self, place: Val, axes: [bool; 2]) -> Val {
        let e = &mut self.expressions;
        let mut found = Val::ZERO;
        for (axis, _) in (0..).zip(axes).filter(|(_, is_asked)| *is_asked) {
            let at = e.component(place, axis);
            let is_below = e.binary(Op::Greater, Val::ZERO, at);
            let is_above = e.binary(Op::Greater, at, Val::ONE);
            for is_beyond in [is_below, is_above] {
                found = e.binary(Op::Max, found, is_beyond);
            }
        }
        found
    }

    /// `texel * scale + bias`, then an output.
    fn uv_texture(&mut self, at: NodeAddress, output: &Arc<str>) -> Option<Val> {
        let fallback = self.number(at, "fallback").unwrap_or(Val::Constant([0.0, 0.0, 0.0, 1.0]));
        let channel = match &**output {
            "r" => Some(0),
            "g" => Some(1),
            "b" => Some(2),
            "a" => Some(3),
            _ => None,
        };
        let whole = match self.file(at) {
            None => fallback,
            Some(mut file) => {
                let place = self.number_or(at, "st", 0.0);
                let address = ["wrapS", "wrapT"].map(|name| match self.text(at, name).as_deref() {
                    Some("black") => AddressMode::Constant,
                    Some("clamp") => AddressMode::Clamp,
                    Some("repeat" | "periodic") => AddressMode::Periodic,
                    Some("mirror") => AddressMode::Mirror,
                    _ => AddressMode::UseMetadata,
                });
                if let Some(space) = self.text(at, "sourceColorSpace").filter(|space| &**space != "auto") {
                    file.color_space = Some(space);
                }
                let constant = fallback.constant().unwrap_or_default();
                let texture =
                    MaterialTexture { file, address, fallback: constant, has_border: false, auto_color_space: true };
                let lookup = self.uses.lookup(&texture, place)?;
                let texel = self.expressions.op(Op::Texture, [place, Val::ZERO, Val::ZERO], lookup);
                let (scale, bias) = (self.number_or(at, "scale", 1.0), self.number_or(at, "bias", 0.0));
                let scaled = self.expressions.multiply(texel, scale);
                self.expressions.add(scaled, bias)
            }
        };
        Some(channel.map_or(whole, |channel| self.expressions.component(whole, channel)))
    }
}
