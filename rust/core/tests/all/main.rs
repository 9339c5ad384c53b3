// SPDX-License-Identifier: Apache-2.0
//! Tests of the core against known answers: brute force, closed forms, published values. A module has the name of the
//! module of the crate that it tests.

#[cfg(test)]
mod adaptive;
#[cfg(test)]
mod array;
#[cfg(test)]
mod camera;
#[cfg(test)]
mod convergence;
#[cfg(test)]
mod instancing;
#[cfg(test)]
mod material;
#[cfg(test)]
mod mesh;
#[cfg(test)]
mod partition;
#[cfg(test)]
mod path_expression;
#[cfg(test)]
mod residency;
#[cfg(test)]
mod scene;
#[cfg(test)]
mod settings;
#[cfg(test)]
mod support;
