// SPDX-License-Identifier: Apache-2.0
//! Geometric nodes, and primvar readers of `UsdPreviewSurface`.

use crate::expression::Val;
use crate::program::{Geometry, Op};
use crate::uses::MaterialUses;
use crate::value::PortType;
use crate::walk::{NetworkWalker, NodeAddress};

impl NetworkWalker<'_> {
    pub(super) fn geometric(&mut self, at: NodeAddress, category: &str, ty: PortType) -> Option<Val> {
        Some(match category {
            "position" => self.by_space(at, Geometry::Position),
            "normal" => self.by_space(at, Geometry::Normal),
            "tangent" => self.by_space(at, Geometry::Tangent),
            "bitangent" => self.by_space(at, Geometry::Bitangent),
            "viewdirection" => self.view_direction(at),
            "facingratio" => self.facing_ratio(at),
            "texcoord" => {
                let index = self.number_or(at, "index", 0.0).constant().map_or(0.0, |index| index[0]);
                if index >= 0.5 { self.texcoord(&format!("st{index:.0}")) } else { self.texcoord("st") }
            }
            "geomcolor" => {
                let color = self.primvar("displayColor", [0.0, 0.0, 0.0, 1.0]);
                if ty == PortType::Float { self.expressions.component(color, 0) } else { color }
            }
            "geompropvalue" | "geompropvalueuniform" => self.named(at, "geomprop", "default", ty)?,
            "UsdPrimvarReader" => self.named(at, "varname", "fallback", ty)?,
            "frame" => Val::ONE,
            "time" => Val::ZERO,
            "normalmap" => self.normal_map(at),
            "transformnormal" if self.spaces(at).is_some() => self.transformed_normal(at),
            // Spaces other than the world are not distinguished in vectors that come from the surface.
            "transformpoint" | "transformvector" | "transformnormal" => {
                let (from, to) = (self.text(at, "fromspace"), self.text(at, "tospace"));
                if from != to {
                    let path = self.path(at);
                    self.problem(format!("`{category}` ({path}) changes nothing: spaces are not supported"));
                }
                let a = self.input_in(at);
                if category == "transformnormal" { self.expressions.normalize(a, 3) } else { a }
            }
            _ => return None,
        })
    }

    /// Two flags: true if a node transforms from the world, and true if to the world; the other space is the object's.
    /// `None` for unknown spaces.
    fn spaces(&mut self, at: NodeAddress) -> Option<[bool; 2]> {
        let is_world = |walker: &mut Self, name: &str| match walker.text(at, name).as_deref() {
            Some("world") => Some(true),
            Some("object" | "model") => Some(false),
            _ => None,
        };
        Some([is_world(self, "fromspace")?, is_world(self, "tospace")?])
    }

    /// A normal of the mesh's frame transformed to the world, or the other way round; unit.
    fn transformed_normal(&mut self, at: NodeAddress) -> Val {
        let normal = self.input_in(at);
        match self.spaces(at) {
            Some([false, true]) => return self.normal_of_object(normal),
            Some([true, false]) if !self.is_displacing => {}
            _ => return self.expressions.normalize(normal, 3),
        }
        // The inverse of a map with columns x, y, z has rows y x z, z x x, x x y over x . (y x z).
        let [x, y, z] = self.object_frame();
        let e = &mut self.expressions;
        let rows = [(y, z), (z, x), (x, y)].map(|(a, b)| e.binary(Op::Cross, a, b));
        let volume = e.dot(x, rows[0], 3);
        let side = e.unary(Op::Sign, volume);
        let parts = rows.map(|row| e.dot(row, normal, 3));
        let vector = e.combine(&parts);
        let vector = e.multiply(vector, side);
        e.normalize(vector, 3)
    }

    fn by_space(&mut self, at: NodeAddress, what: Geometry) -> Val {
        let is_world = self.text(at, "space").as_deref() == Some("world");
        self.geometry(at, what, is_world)
    }

    fn view_direction(&mut self, at: NodeAddress) -> Val {
        if self.is_displacing {
            let (category, path) = (self.category(at), self.path(at));
            self.problem(format!(
                "`{category}` ({path}) is not known where meshes are displaced: it displaces nothing"
            ));
        }
        self.expressions.geometry(Geometry::ViewDirection)
    }

    /// The primvar that an input names.
    fn named(&mut self, at: NodeAddress, name: &str, fallback: &str, ty: PortType) -> Option<Val> {
        let Some(variable) = self.text(at, name).filter(|text| !text.is_empty()) else {
            return self.number(at, fallback);
        };
        if ty == PortType::Vector2 {
            return Some(self.texcoord(&variable));
        }
        if ty.width() == 0 {
            return None;
        }
        let fallback = self.number_or(at, fallback, 0.0).constant().unwrap_or_default();
        let value = self.primvar(&variable, fallback);
        Some(if ty == PortType::Float { self.expressions.component(value, 0) } else { value })
    }

    /// |V . N|, or 1 less it.
    fn facing_ratio(&mut self, at: NodeAddress) -> Val {
        let is_authored = self.is_authored(at, "viewdirection");
        let toward = if is_authored { self.number_or(at, "viewdirection", 0.0) } else { self.view_direction(at) };
        let normal = self.declared_or(at, "normal", Geometry::Normal);
        let facing = self.number(at, "faceforward").unwrap_or(Val::ONE);
        let invert = self.number_or(at, "invert", 0.0);
        let e = &mut self.expressions;
        let cosine = e.dot(toward, normal, 3);
        let (size, signed) = (e.unary(Op::Absolute, cosine), e.subtract(Val::ZERO, cosine));
        let ratio = e.op(Op::Select, [size, signed, facing], 0);
        let rest = e.complement(ratio);
        e.op(Op::Select, [rest, ratio, invert], 0)
    }

    /// The authored value of an input, else that of the surface.
    fn declared_or(&mut self, at: NodeAddress, name: &str, what: Geometry) -> Val {
        let authored = if self.is_authored(at, name) { self.number(at, name) } else { None };
        authored.unwrap_or_else(|| self.expressions.geometry(what))
    }

    /// Returns true if a normal map is one of tangent space, about the surface's own normal and tangents.
    pub(crate) fn is_of_own_tangents(&mut self, at: NodeAddress) -> bool {
        !self.is_of_object(at) && self.is_own_frame(at)
    }

    /// Returns true if a normal map is one of the object's space, which `MaterialX` 1.38 has.
    pub(crate) fn is_of_object(&mut self, at: NodeAddress) -> bool {
        self.text(at, "space").as_deref() == Some("object")
    }

    /// The value of the input, or the surface's bitangent; for a node of `MaterialX` 1.38, which has no such input, the
    /// vector orthogonal to the given normal and tangent.
    fn bitangent(&mut self, at: NodeAddress, normal: Val, tangent: Val) -> Val {
        let is_authored = |name: &str| self.is_authored(at, name);
        let is_free = is_authored("normal") || is_authored("tangent");
        if is_free && !is_authored("bitangent") && self.is_older(at) && !self.is_own_frame(at) {
            let e = &mut self.expressions;
            let across = e.binary(Op::Cross, normal, tangent);
            return e.normalize(across, 3);
        }
        self.declared_or(at, "bitangent", Geometry::Bitangent)
    }

    /// Returns true if a normal is about the surface's own normal and tangents.
    pub(crate) fn is_own_frame(&mut self, at: NodeAddress) -> bool {
        let own = [("normal", Geometry::Normal), ("tangent", Geometry::Tangent), ("bitangent", Geometry::Bitangent)];
        own.into_iter().all(|(name, what)| self.declared_or(at, name, what) == self.expressions.geometry(what))
    }

    /// The vector that a normal map encodes, 2 x - 1, not normalised.
    pub(crate) fn decoded_normal(&mut self, at: NodeAddress) -> Val {
        let mut value = self.number(at, "in").unwrap_or(Val::Constant([0.5, 0.5, 1.0, 0.0]));
        // A value of 0 means flat. This is not tested for texels: a map would not be a texture of the surface any more.
        if value.is(0.0, 3) {
            value = Val::Constant([0.5, 0.5, 1.0, 0.0]);
        }
        let twice = self.expressions.multiply(value, Val::number(2.0));
        self.expressions.subtract(twice, Val::ONE)
    }

    /// The vector that a normal map encodes in the frame of the surface, not normalised.
    pub(crate) fn tangent_space_normal(&mut self, at: NodeAddress) -> Val {
        let vector = self.decoded_normal(at);
        let scale = self.number_or(at, "scale", 1.0);
        let e = &mut self.expressions;
        let scale = e.splice(scale, 2, Val::ONE);
        e.multiply(vector, scale)
    }

    /// A normal map in the world.
    fn normal_map(&mut self, at: NodeAddress) -> Val {
        if self.is_of_object(at) {
            let vector = self.decoded_normal(at);
            return self.normal_of_object(vector);
        }
        let local = self.tangent_space_normal(at);
        self.in_world(at, local)
    }

    /// A normal of the mesh's frame in the world, unit: by the map of [`MaterialUses::OBJECT_FRAME`]. For a displaced
    /// mesh, its own frame is the world.
    pub(super) fn normal_of_object(&mut self, normal: Val) -> Val {
        if self.is_displacing {
            return self.expressions.normalize(normal, 3);
        }
        let [x, y, z] = self.object_frame();
        let e = &mut self.expressions;
        let mut sum = Val::ZERO;
        for (axis, k) in [x, y, z].into_iter().zip(0..) {
            let share = e.component(normal, k);
            let part = e.multiply(axis, share);
            sum = e.add(sum, part);
        }
        e.normalize(sum, 3)
    }

    /// The axes of the mesh's frame transformed as normals, up to a factor.
    fn object_frame(&mut self) -> [Val; 3] {
        // The frame of the world is used if there are too many primvars.
        let at_rest = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]];
        let [x, y] = [0, 1].map(|k| self.primvar(MaterialUses::OBJECT_FRAME[k], at_rest[k]));
        let e = &mut self.expressions;
        // (a, b) is (x, y) / (|x| + |y| + |z|) above the plane z = 0; below it the four triangles are folded out.
        let [a, b] = [x, y].map(|axis| e.component(axis, 3));
        let pair = e.combine(&[a, b, Val::ZERO]);
        let sizes = e.unary(Op::Absolute, pair);
        let sum = e.dot(sizes, Val::ONE, 2);
        let above = e.complement(sum);
        let below = e.subtract(Val::ZERO, above);
        let fold = e.binary(Op::Max, below, Val::ZERO);
        let is_right = e.binary(Op::GreaterEqual, pair, Val::ZERO);
        let back = e.subtract(Val::ZERO, fold);
        let by = e.op(Op::Select, [back, fold, is_right], 0);
        let flat = e.add(pair, by);
        let z = e.splice(flat, 2, above);
        let z = e.normalize(z, 3);
        [x, y, z]
    }

    /// A vector in the frame of the surface, about the normal that a node sets.
    pub(super) fn in_world(&mut self, at: NodeAddress, local: Val) -> Val {
        let normal = self.number(at, "normal").unwrap_or_else(|| self.expressions.geometry(Geometry::Normal));
        let tangent = self.declared_or(at, "tangent", Geometry::Tangent);
        let bitangent = self.bitangent(at, normal, tangent);
        let e = &mut self.expressions;
        let frame = [tangent, bitangent, normal];
        let mut sum = Val::ZERO;
        for (axis, along) in frame.into_iter().zip(0..) {
            let share = e.component(local, along);
            let part = e.multiply(axis, share);
            sum = e.add(sum, part);
        }
        e.normalize(sum, 3)
    }
}
