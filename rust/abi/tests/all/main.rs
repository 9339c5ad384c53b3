// SPDX-License-Identifier: Apache-2.0
//! The sampler, and the table of lobes.

#[cfg(test)]
mod lobes;
#[cfg(test)]
mod sampler;
