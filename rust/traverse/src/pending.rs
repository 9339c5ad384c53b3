// SPDX-License-Identifier: Apache-2.0
//! Streaming: the absent chunk instances that a ray has come to, the nearest four (traversal/pending.glsl). Pure, any
//! thread.

use oocpt_shader_abi::pack_waiting;

const MAX: usize = oocpt_shader_abi::MAX_PENDING as usize;

/// Where a chunk instance comes in the order of a ray.
pub(crate) type Key = (f32, u32);

/// Whether `a` comes before `b`.
pub(crate) fn before(a: Key, b: Key) -> bool {
    a.0 < b.0 || (a.0 == b.0 && a.1 < b.1)
}

/// See the module.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Pending {
    keys: [Key; MAX],
    count: usize,
    more: bool,
}

impl Pending {
    pub(crate) fn clear(&mut self) {
        (self.count, self.more) = (0, false);
    }

    /// Those of the list, in order.
    pub(crate) fn keys(&self) -> &[Key] {
        &self.keys[..self.count]
    }

    /// Notes an absent chunk instance; of more than four the nearest stay.
    pub(crate) fn remember(&mut self, key: Key) {
        let mut at = self.count;
        if at == MAX {
            self.more = true;
            at -= 1;
            if !before(key, self.keys[at]) {
                return;
            }
        } else {
            self.count += 1;
        }
        while at > 0 && before(key, self.keys[at - 1]) {
            self.keys[at] = self.keys[at - 1];
            at -= 1;
        }
        self.keys[at] = key;
    }

    /// Drops what is entered behind `limit`; the rest of the instances is behind all of the list.
    pub(crate) fn forget_behind(&mut self, limit: f32) {
        while self.count > 0 && self.keys[self.count - 1].0 > limit {
            self.count -= 1;
            self.more = false;
        }
    }

    /// The flags of a ray that waits for these.
    pub(crate) fn flags(&self) -> u32 {
        pack_waiting(u32::try_from(self.count).unwrap_or(0), self.more)
    }
}
