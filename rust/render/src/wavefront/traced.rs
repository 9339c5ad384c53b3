// SPDX-License-Identifier: Apache-2.0
//! Which rays are traced. Plain data.

/// The rays of a round that are traced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TracedRays {
    /// Those that continue paths.
    Closest,
    /// Those that look for light from the surfaces shaded last.
    Shadow,
    /// Both.
    All,
}
