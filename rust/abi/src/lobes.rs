// SPDX-License-Identifier: Apache-2.0
//! The table of BSDF lobes. From it the build writes the code that goes through all lobes: probabilities, sampling and
//! evaluation (`generated/lobes.glsl`, `generated/lobe_functions.glsl`).
//!
//! A row is the only declaration of a lobe in the tables; its code is `shaders/material/bsdf/lobes/NAME.glsl`, and
//! `shaders/material/bsdf/lobe.glsl` lists the functions that it has. Pure, any thread.

use super::Features;

/// The normal of a lobe: the lobe is evaluated for directions that are on the same side of it as of the surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LobeNormal {
    /// The shading normal.
    Shading,
    /// The normal of the specular layers, which is bent towards the viewer.
    Layers,
}

/// Sides of the surface to which a lobe scatters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LobeSides {
    /// It scatters to the viewer's side.
    Reflects,
    /// It scatters to both sides.
    Both,
}

/// The one of a light's two multipliers that a lobe uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LobePart {
    /// The multiplier `inputs:diffuse`.
    Diffuse,
    /// The multiplier `inputs:specular`.
    Specular,
}

/// A row of [`LOBES`].
#[derive(Debug, Clone, Copy)]
pub struct LobeRow {
    /// Name of its file and its functions.
    pub name: &'static str,
    /// Features without all of which it is not compiled in.
    pub needs: Features,
    /// Normal of the lobe.
    pub normal: LobeNormal,
    /// Sides to which it scatters.
    pub sides: LobeSides,
    /// Multiplier of lights that it uses.
    pub part: LobePart,
}

macro_rules! lobes {
    ($($(#[$only:meta])* $name:ident: [$($needs:ident),*], $normal:ident, $sides:ident, $part:ident;)+) => {
        /// Every lobe, in the order in which a random number chooses one.
        pub const LOBES: &[LobeRow] = &[$($(#[$only])* LobeRow {
            name: stringify!($name),
            needs: Features::empty()$(.union(Features::$needs))*,
            normal: LobeNormal::$normal,
            sides: LobeSides::$sides,
            part: LobePart::$part,
        },)+];
    };
}

lobes! {
    coat: [COAT], Layers, Reflects, Specular;
    specular: [MATERIALS], Layers, Reflects, Specular;
    diffuse: [], Shading, Reflects, Diffuse;
    scatter: [MATERIALS], Shading, Reflects, Specular;
    sheen: [SHEEN], Layers, Reflects, Specular;
    glass: [TRANSMISSION], Layers, Both, Specular;
    glass_scatter: [ROUGH_TRANSMISSION], Shading, Both, Specular;
    #[cfg(feature = "faults")]
    toy_lobe: [TOY_LOBE], Layers, Reflects, Specular;
}

/// The lobe that may be the only one of a surface: Lambert.
pub const LOBE_ALONE: &str = "diffuse";

/// The order in which albedos are added. Sums of floats depend on it, so it stays as it was; lobes that are not listed
/// come after these.
pub const LOBES_ADDED: &[&str] = &["coat", "specular", "diffuse", "scatter", "glass", "glass_scatter", "sheen"];

/// The order in which values and densities are evaluated.
pub const LOBES_EVALUATED: &[&str] = &["scatter", "diffuse", "glass_scatter", "specular", "coat", "sheen", "glass"];

/// Every lobe, `first` before the others.
pub fn lobes_in_order(first: &[&'static str]) -> Vec<&'static LobeRow> {
    let named = first.iter().filter_map(|name| LOBES.iter().find(|lobe| lobe.name == *name));
    named.chain(LOBES.iter().filter(|lobe| !first.contains(&lobe.name))).collect()
}
