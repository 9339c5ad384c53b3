// SPDX-License-Identifier: Apache-2.0
//! Instancers and their placements, against brute force and closed forms.

mod flattening;
mod hierarchies;
mod instance_primvars;
mod motion;
