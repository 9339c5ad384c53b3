// SPDX-License-Identifier: Apache-2.0
//! Reads what kinds of rays see a prim, and whether it is a matte or a shadow catcher, from the primvars that
//! renderers have for it.
//!
//! Pure, any thread. Of several renderers' primvars those of the first one in [`ROWS`] count, for visibility and for
//! mattes apart: scenes carry the settings of more than one.

use oocpt_abi::PrimMask;

/// What a primvar says.
#[derive(Clone, Copy, Debug)]
enum MaskRule {
    /// 0: these rays pass.
    Switch(PrimMask),
    /// Names of kinds, see [`of_names`].
    Names,
    /// Bits of the kinds that see the prim, as in [`ARNOLD_BITS`].
    Bits,
    /// Not 0: a matte.
    Matte,
    /// Not 0: a shadow catcher.
    Catcher,
    /// Karma's mode: 1 is a matte, 2 one that shadows the background.
    Holdout,
}

/// Bits of Arnold's `visibility`, and the rays that pass without them. Those of other kinds do not count.
const ARNOLD_BITS: [(u32, PrimMask); 5] = [
    (1, PrimMask::NO_CAMERA),
    (1 << 1, PrimMask::NO_SHADOW),
    (1 << 3, PrimMask::NO_TRANSMISSION),
    (1 << 5, PrimMask::NO_DIFFUSE),
    (1 << 6, PrimMask::NO_REFLECTION),
];

/// Primvars by name. What is before the first colon names the renderer.
const ROWS: [(&str, MaskRule); 18] = [
    ("oocpt:visibility", MaskRule::Names),
    ("oocpt:matte", MaskRule::Matte),
    ("oocpt:shadowCatcher", MaskRule::Catcher),
    ("ri:attributes:visibility:camera", MaskRule::Switch(PrimMask::NO_CAMERA)),
    ("ri:attributes:visibility:indirect", MaskRule::Switch(PrimMask::INDIRECT)),
    ("ri:attributes:visibility:transmission", MaskRule::Switch(PrimMask::NO_SHADOW)),
    ("ri:attributes:Ri:Matte", MaskRule::Matte),
    ("ri:attributes:trace:holdout", MaskRule::Catcher),
    ("karma:object:rendervisibility", MaskRule::Names),
    ("karma:object:holdoutmode", MaskRule::Holdout),
    ("arnold:visibility", MaskRule::Bits),
    ("arnold:visibility:camera", MaskRule::Switch(PrimMask::NO_CAMERA)),
    ("arnold:visibility:shadow", MaskRule::Switch(PrimMask::NO_SHADOW)),
    ("arnold:visibility:diffuse_reflect", MaskRule::Switch(PrimMask::NO_DIFFUSE)),
    ("arnold:visibility:specular_reflect", MaskRule::Switch(PrimMask::NO_REFLECTION)),
    ("arnold:visibility:specular_transmit", MaskRule::Switch(PrimMask::NO_TRANSMISSION)),
    ("arnold:matte", MaskRule::Matte),
    ("cycles:object:is_shadow_catcher", MaskRule::Catcher),
];

/// The kinds of rays by their names: the bit of a prim that they do not see; empty for those that do not exist here.
fn kind(name: &str) -> Option<PrimMask> {
    Some(match name {
        "camera" | "primary" => PrimMask::NO_CAMERA,
        "shadow" => PrimMask::NO_SHADOW,
        "diffuse" => PrimMask::NO_DIFFUSE,
        "reflect" | "reflection" => PrimMask::NO_REFLECTION,
        "refract" | "transmission" => PrimMask::NO_TRANSMISSION,
        "*" | "all" => PrimMask::INDIRECT | PrimMask::NO_CAMERA | PrimMask::NO_SHADOW,
        "indirect" => PrimMask::INDIRECT,
        "volume" | "subsurface" | "probe" => PrimMask::empty(),
        _ => return None,
    })
}

/// The start of a text from a scene, for messages.
fn start(text: &str) -> String {
    text.chars().take(40).collect()
}

/// Reads names of kinds as Karma has them: those that see the prim (`primary|shadow`), all (`*`), or all but those
/// after a minus or a circumflex (`-diffuse`, `* ^shadow`); without a name nothing sees it.
fn of_names(text: &str) -> Result<PrimMask, String> {
    let all = PrimMask::INDIRECT | PrimMask::NO_CAMERA | PrimMask::NO_SHADOW;
    let is_taken_away = |name: &str| name.starts_with(['-', '^']);
    let mut names = text.split(|c: char| c.is_whitespace() || "|,&".contains(c)).filter(|n| !n.is_empty()).peekable();
    let mut passes = if names.peek().is_some_and(|name| is_taken_away(name)) { PrimMask::empty() } else { all };
    for name in names {
        let Some(rays) = kind(name.trim_start_matches(['-', '^', '+'])) else {
            return Err(format!(
                "{} is no kind of ray (camera, shadow, diffuse, reflection, transmission)",
                start(name)
            ));
        };
        passes = if is_taken_away(name) { passes | rays } else { passes - rays };
    }
    Ok(passes)
}

/// A number or a word that means one.
fn number(text: &str) -> Result<f64, String> {
    match text.trim() {
        "true" => Ok(1.0),
        "false" => Ok(0.0),
        text => text.parse().ok().filter(|n: &f64| n.is_finite()).ok_or(format!("{} is no number", start(text))),
    }
}

impl MaskRule {
    fn is_of_mattes(self) -> bool {
        matches!(self, Self::Matte | Self::Catcher | Self::Holdout)
    }

    /// The bits that a value sets.
    fn read(self, text: &str) -> Result<PrimMask, String> {
        let given = |mask: PrimMask, is_set: bool| if is_set { mask } else { PrimMask::empty() };
        Ok(match self {
            Self::Names => of_names(text)?,
            Self::Switch(rays) => given(rays, number(text)? == 0.0),
            Self::Matte => given(PrimMask::MATTE, number(text)? != 0.0),
            Self::Catcher => given(PrimMask::SHADOW_CATCHER, number(text)? != 0.0),
            Self::Bits => {
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "rounded and clamped")]
                let bits = number(text)?.clamp(0.0, 255.0) as u32;
                ARNOLD_BITS.iter().filter(|(bit, _)| bits & bit == 0).map(|(_, rays)| *rays).collect()
            }
            Self::Holdout => match number(text)? {
                0.0 => PrimMask::empty(),
                1.0 => PrimMask::MATTE,
                2.0 => PrimMask::SHADOW_CATCHER,
                other => return Err(format!("{other} is no mode")),
            },
        })
    }
}

/// The names of the primvars that [`read_prim_mask`] knows, without `primvars:`.
pub fn prim_mask_names() -> impl Iterator<Item = &'static str> {
    ROWS.iter().map(|(name, _)| *name)
}

/// Reads the mask of a prim from primvars, names and values as text; also says what makes no sense, by name.
#[must_use]
pub fn read_prim_mask(primvars: &[(&str, &str)]) -> (PrimMask, Vec<(&'static str, String)>) {
    let mut mask = PrimMask::empty();
    let mut problems = Vec::new();
    for of_mattes in [false, true] {
        let mut renderer = None;
        for (name, rule) in ROWS.iter().filter(|(_, rule)| rule.is_of_mattes() == of_mattes) {
            let Some((_, text)) = primvars.iter().find(|(given, _)| given == name) else { continue };
            let own = name.split(':').next();
            if renderer.is_some_and(|renderer| renderer != own) {
                break;
            }
            renderer = Some(own);
            match rule.read(text) {
                Ok(bits) => mask |= bits,
                Err(problem) => problems.push((*name, problem)),
            }
        }
    }
    (mask, problems)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(primvars: &[(&str, &str)]) -> PrimMask {
        let (mask, problems) = read_prim_mask(primvars);
        assert!(problems.is_empty(), "{primvars:?}: {problems:?}");
        mask
    }

    #[test]
    fn every_renderers_primvars_hide_from_their_kinds_of_rays() {
        let (camera, shadow) = (PrimMask::NO_CAMERA, PrimMask::NO_SHADOW);
        let (diffuse, reflection, through) = (PrimMask::NO_DIFFUSE, PrimMask::NO_REFLECTION, PrimMask::NO_TRANSMISSION);
        let cases = [
            ("oocpt:visibility", "-camera", camera),
            ("oocpt:visibility", "camera shadow", diffuse | reflection | through),
            ("ri:attributes:visibility:camera", "0", camera),
            ("ri:attributes:visibility:camera", "1", PrimMask::empty()),
            ("ri:attributes:visibility:indirect", "0", diffuse | reflection | through),
            ("ri:attributes:visibility:transmission", "0", shadow),
            ("ri:attributes:Ri:Matte", "1", PrimMask::MATTE),
            ("karma:object:rendervisibility", "*", PrimMask::empty()),
            ("karma:object:rendervisibility", "* ^shadow", shadow),
            ("karma:object:rendervisibility", "-primary|-refract", camera | through),
            ("karma:object:rendervisibility", "primary|shadow", diffuse | reflection | through),
            ("karma:object:rendervisibility", "", camera | shadow | diffuse | reflection | through),
            ("karma:object:holdoutmode", "1.000000", PrimMask::MATTE),
            ("karma:object:holdoutmode", "0", PrimMask::empty()),
            ("karma:object:holdoutmode", "2", PrimMask::SHADOW_CATCHER),
            ("oocpt:shadowCatcher", "1", PrimMask::SHADOW_CATCHER),
            ("ri:attributes:trace:holdout", "1", PrimMask::SHADOW_CATCHER),
            ("cycles:object:is_shadow_catcher", "true", PrimMask::SHADOW_CATCHER),
            ("arnold:visibility", "255", PrimMask::empty()),
            ("arnold:visibility", "254", camera),
            ("arnold:visibility", "33", shadow | reflection | through),
            ("arnold:visibility:camera", "0", camera),
            ("arnold:visibility:shadow", "false", shadow),
            ("arnold:visibility:diffuse_reflect", "0", diffuse),
            ("arnold:visibility:specular_reflect", "0", reflection),
            ("arnold:visibility:specular_transmit", "0", through),
            ("arnold:matte", "true", PrimMask::MATTE),
        ];
        for (name, value, mask) in cases {
            assert_eq!(read(&[(name, value)]), mask, "{name} {value:?}");
        }
    }

    #[test]
    fn the_first_renderer_counts_for_visibility_and_for_mattes_apart() {
        let arnold = ("arnold:visibility:shadow", "0");
        let (ri, matte) = (("ri:attributes:visibility:camera", "0"), ("arnold:matte", "1"));
        assert_eq!(read(&[arnold, ri]), PrimMask::NO_CAMERA, "RenderMan's come first");
        assert_eq!(read(&[arnold, ri, matte]), PrimMask::NO_CAMERA | PrimMask::MATTE);
        assert_eq!(read(&[arnold, ("oocpt:visibility", "*")]), PrimMask::empty(), "OocPT's own before all");
        let both = [("ri:attributes:visibility:transmission", "0"), ri];
        assert_eq!(read(&both), PrimMask::NO_CAMERA | PrimMask::NO_SHADOW, "all of one renderer's");
    }

    #[test]
    fn what_makes_no_sense_is_said_and_changes_nothing() {
        let long = "x".repeat(10_000);
        let cases = [
            ("oocpt:visibility", "-camera|-gamma", "gamma is no kind of ray"),
            ("oocpt:visibility", &*long, "xxxx"),
            ("ri:attributes:visibility:camera", "maybe", "maybe is no number"),
            ("arnold:visibility", "nan", "nan is no number"),
            ("karma:object:holdoutmode", "7", "7 is no mode"),
        ];
        for (name, value, said) in cases {
            let (mask, problems) = read_prim_mask(&[(name, value)]);
            assert_eq!(mask, PrimMask::empty(), "{name}");
            assert!(matches!(&problems[..], [(of, text)] if *of == name && text.contains(said)), "{problems:?}");
            assert!(problems[0].1.len() < 150, "no message is as long as its text");
        }
        assert_eq!(read_prim_mask(&[("arnold:visibility", "1e300")]).0, PrimMask::empty(), "all bits");
        assert_eq!(read_prim_mask(&[("st", "0")]), (PrimMask::empty(), Vec::new()), "others do not count");
    }
}
