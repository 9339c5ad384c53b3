// SPDX-License-Identifier: Apache-2.0
//! The table of BSDF lobes. The build writes from it what goes through all of them: chances, sampling and evaluation
//! (`generated/lobes.glsl`, `generated/lobe_functions.glsl`).
//!
//! A row is all there is to declare; the lobe itself is `shaders/material/bsdf/lobes/NAME.glsl`, and
//! `shaders/material/bsdf/lobe.glsl` says which functions it has. Pure, any thread.

use super::Features;

/// The normal that a lobe is about: it counts for directions on the same side of it as they are of the surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LobeNormal {
    /// The shading normal.
    Shading,
    /// That of the specular layers, which is bent to see the viewer.
    Layers,
}

/// Where a lobe's light goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LobeSides {
    /// To the viewer's side.
    Reflects,
    /// To both.
    Both,
}

/// Which of a light's two multipliers counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LobePart {
    /// `inputs:diffuse`.
    Diffuse,
    /// `inputs:specular`.
    Specular,
}

/// A row of [`LOBES`].
#[derive(Debug, Clone, Copy)]
pub struct LobeRow {
    /// Of its file and its functions.
    pub name: &'static str,
    /// Without all of these it is not compiled in.
    pub needs: Features,
    /// The normal that it is about.
    pub normal: LobeNormal,
    /// Where its light goes.
    pub sides: LobeSides,
    /// Which of a light's multipliers counts.
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

/// The lobe that may be all of a surface: Lambert.
pub const LOBE_ALONE: &str = "diffuse";

/// The order in which albedos are added. Sums of floats depend on it, so it stays as pictures know it; lobes that are
/// not here come after these.
pub const LOBES_ADDED: &[&str] = &["coat", "specular", "diffuse", "scatter", "glass", "glass_scatter", "sheen"];

/// The same of values and densities.
pub const LOBES_EVALUATED: &[&str] = &["scatter", "diffuse", "glass_scatter", "specular", "coat", "sheen", "glass"];

/// Every lobe, `first` before the others.
pub fn lobes_in_order(first: &[&'static str]) -> Vec<&'static LobeRow> {
    let named = first.iter().filter_map(|name| LOBES.iter().find(|lobe| lobe.name == *name));
    named.chain(LOBES.iter().filter(|lobe| !first.contains(&lobe.name))).collect()
}
