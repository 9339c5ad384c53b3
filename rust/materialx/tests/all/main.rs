// SPDX-License-Identifier: Apache-2.0
//! Translated networks: against `MaterialX`'s specification, and hostile ones.

#[cfg(test)]
mod custom_definitions;
#[cfg(test)]
mod definitions;
#[cfg(test)]
mod displacement;
#[cfg(test)]
mod hair;
#[cfg(test)]
mod height;
#[cfg(test)]
mod hostile;
#[cfg(test)]
mod mixtures;
#[cfg(test)]
mod nodes;
#[cfg(test)]
mod noise_and_color;
#[cfg(test)]
mod opacity;
mod operations;
#[cfg(test)]
mod support;
#[cfg(test)]
mod surfaces;
#[cfg(test)]
mod v1_38;
