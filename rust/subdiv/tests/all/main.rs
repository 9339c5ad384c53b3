// SPDX-License-Identifier: Apache-2.0
//! Limit surfaces against closed forms, the same bits whatever the blocks and threads, and invalid topologies.

#[cfg(test)]
mod blocks;
#[cfg(test)]
mod hostile;
#[cfg(test)]
mod limit_surfaces;
#[cfg(test)]
mod shapes;
