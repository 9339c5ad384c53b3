// SPDX-License-Identifier: Apache-2.0
//! The compiled shaders: layouts of the shared structs, folding, what passes read, and the table of passes.

#[cfg(test)]
mod fold;
#[cfg(test)]
mod launch;
#[cfg(test)]
mod layout;
#[cfg(test)]
mod no_contraction;
#[cfg(test)]
mod pass_reads;
#[cfg(test)]
mod table;
