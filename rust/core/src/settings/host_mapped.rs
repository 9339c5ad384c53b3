// SPDX-License-Identifier: Apache-2.0
//! The setting that lets the device read geometry in host memory. Pure, any thread.

use serde::{Deserialize, Serialize};

/// Decides if rays may read geometry that has no room on the device from host memory, across the bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum HostMapped {
    /// On devices that have memory of their own.
    #[default]
    Auto,
    /// Always; for tests, on devices that share the memory of the host.
    On,
    /// Never: rays wait until geometry is loaded.
    Off,
}

impl HostMapped {
    /// All values, in the order of the documentation.
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

    /// The value of this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}
