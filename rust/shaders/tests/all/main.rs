// SPDX-License-Identifier: Apache-2.0
//! The shared structs and the compiled shaders: layouts, folding, what passes read, and the tables of passes and lobes.

#[cfg(test)]
mod fold;
#[cfg(test)]
mod launch;
#[cfg(test)]
mod layout;
#[cfg(test)]
mod lobes;
#[cfg(test)]
mod no_contraction;
#[cfg(test)]
mod pass_reads;
#[cfg(test)]
mod table;
