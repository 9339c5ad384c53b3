// SPDX-License-Identifier: Apache-2.0
//! The setting of the traversal backend. Pure, any thread.

use serde::{Deserialize, Serialize};

/// The traversal backend, which finds the hits of rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TraversalKind {
    /// The host if the device is a processor, else the device.
    #[default]
    Auto,
    /// Compute shaders of the device.
    Compute,
    /// The host's threads; only if the device shares the memory of the host.
    Native,
}

impl TraversalKind {
    /// All values, in the order of the documentation.
    pub const ALL: [Self; 3] = [Self::Auto, Self::Compute, Self::Native];

    /// The name in settings and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Compute => "compute",
            Self::Native => "native",
        }
    }

    /// The value of this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}
