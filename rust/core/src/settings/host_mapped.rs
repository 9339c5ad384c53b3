// SPDX-License-Identifier: Apache-2.0
//! Whether the device reads geometry in host memory. Pure, any thread.

use serde::{Deserialize, Serialize};

/// Whether rays may read geometry that has no room on the device where it lies in host memory, across the bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum HostMapped {
    /// Where the device has memory of its own.
    #[default]
    Auto,
    /// Always: for tests, on devices whose memory is the host's.
    On,
    /// Never: rays wait until geometry has come.
    Off,
}

impl HostMapped {
    /// All, in the order of the documentation.
    pub const ALL: [Self; 3] = [Self::Auto, Self::On, Self::Off];

    /// The name in settings and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::On => "on",
            Self::Off => "off",
        }
    }

    /// The one of this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}
