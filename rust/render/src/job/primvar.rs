// SPDX-License-Identifier: Apache-2.0
//! Primvars that images are wanted of. A name has a number for as long as the process lives, so that an image's kind
//! stays a small value.

use crate::sync::lock;
use std::sync::{Arc, Mutex};

/// Most different names of a process.
const MAX_KNOWN: usize = 1 << 12;
/// Most bytes of a name.
const MAX_NAME: usize = 256;

/// What a primvar's image shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PrimvarImage {
    name: u16,
    /// It is that of the pixel's centre, whatever the setting says: the mean of numbers that count is none of them.
    pub(crate) is_centred: bool,
}

static KNOWN: Mutex<Vec<Arc<str>>> = Mutex::new(Vec::new());

impl PrimvarImage {
    /// The image of the primvar of this name, with or without `primvars:` before it.
    ///
    /// # Errors
    /// It is no name, or there are too many; the text is for users.
    pub fn of(name: &str, is_centred: bool) -> Result<Self, String> {
        let name = name.strip_prefix("primvars:").unwrap_or(name);
        if name.is_empty() || name.len() > MAX_NAME || name.chars().any(char::is_control) {
            return Err("the sourceName is no name of a primvar".to_owned());
        }
        let mut known = lock(&KNOWN);
        let at = known.iter().position(|have| **have == *name).unwrap_or(known.len());
        if at == known.len() {
            if at >= MAX_KNOWN {
                return Err(format!("the primvar {name}: there were {MAX_KNOWN} others"));
            }
            known.push(name.into());
        }
        let name = u16::try_from(at).map_err(|error| error.to_string())?;
        Ok(Self { name, is_centred })
    }

    /// The name, without `primvars:`.
    pub fn name(self) -> Arc<str> {
        lock(&KNOWN).get(usize::from(self.name)).map_or_else(|| Arc::from(""), Arc::clone)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_has_one_number() {
        let of = |name: &str| PrimvarImage::of(name, false);
        assert!(of("st") == of("primvars:st") && of("st") != of("uv") && of("st") != PrimvarImage::of("st", true));
        assert_eq!(&*of("primvars:user:dust").expect("a name").name(), "user:dust");
        for name in ["", "primvars:", "a\nb", &"x".repeat(300)] {
            assert!(of(name).is_err(), "{name}");
        }
    }
}
