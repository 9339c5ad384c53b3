// SPDX-License-Identifier: Apache-2.0
//! Nodes of `MaterialX` 1.38 that 1.39 replaced. Files keep them, and the data libraries do not define them any more.

use crate::expression::Val;
use crate::value::PortType;
use crate::walk::{NetworkWalker, NodeAddress};

/// What a swizzle takes for the number 0 and the number 1.
const ZERO: u16 = 4;
const ONE: u16 = 5;

impl NetworkWalker<'_> {
    /// `swizzle_color3_float` and the like, which the network names by their definitions; `swizzle` in graphs, and
    /// where the data libraries are those of 1.38.
    pub(super) fn older(&mut self, at: NodeAddress, category: &str, ty: PortType) -> Option<Val> {
        let rest = category.strip_prefix("swizzle")?;
        let (from, to) = match rest.strip_prefix('_').and_then(|types| types.split_once('_')) {
            Some((from, to)) => (PortType::named(from).width(), PortType::named(to).width()),
            None if rest.is_empty() => (self.input_type(at, "in").width(), ty.width()),
            None => return None,
        };
        if from == 0 || to == 0 {
            return None;
        }
        let a = self.input_in(at);
        let channels = self.text(at, "channels").unwrap_or_default();
        let mut letters = channels.chars();
        let mut parts = [ZERO; 4];
        let mut are_known = true;
        for part in parts.iter_mut().take(usize::from(to)) {
            let found = letters.next().and_then(|letter| channel_of(letter, from));
            are_known &= found.is_some();
            *part = found.unwrap_or(ZERO);
        }
        if !are_known || letters.next().is_some() {
            let path = self.path(at);
            self.problem(format!("the channels of `swizzle` ({path}) are not {to} of {from}: what is missing is 0"));
        }
        // A number is in all components.
        Some(self.expressions.swizzle(a, if to == 1 { [parts[0]; 4] } else { parts }))
    }
}

/// The component that a letter of `channels` means, of so many.
fn channel_of(letter: char, width: u16) -> Option<u16> {
    let at = match letter {
        'r' | 'x' => 0,
        'g' | 'y' => 1,
        'b' | 'z' => 2,
        'a' | 'w' => 3,
        '0' => return Some(ZERO),
        '1' => return Some(ONE),
        _ => return None,
    };
    (at < width).then_some(at)
}
