// SPDX-License-Identifier: Apache-2.0
//! The setting of the denoiser. Pure, any thread.

use serde::{Deserialize, Serialize};

/// Which pictures are denoised.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum DenoiseMode {
    /// Only images that somebody asks for by name.
    #[default]
    Off,
    /// The last picture of a render.
    Final,
    /// Pictures on the way as well, where denoising is fast.
    Interactive,
}

impl DenoiseMode {
    /// All values, in the order of the documentation.
    pub const ALL: [Self; 3] = [Self::Off, Self::Final, Self::Interactive];

    /// The name in settings and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Final => "final",
            Self::Interactive => "interactive",
        }
    }

    /// The value of this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|mode| mode.name() == name)
    }
}
