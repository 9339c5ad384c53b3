// SPDX-License-Identifier: Apache-2.0
//! Files that lights name, made on demand.

use oocpt_core::AssetRef;
use oocpt_render::{LightFiles, LightPicture};

/// Pictures and profiles by name.
#[derive(Debug)]
pub(crate) struct TestFiles;

impl TestFiles {
    /// A file of this name.
    pub(crate) fn asset(name: &str) -> AssetRef {
        AssetRef { authored: name.into(), resolved: name.into() }
    }
}

/// A picture of `width x height` texels.
fn picture(width: u32, height: u32, texel: impl Fn(u32, u32) -> [f32; 3]) -> LightPicture {
    let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| texel(x, y)).collect();
    LightPicture { width, height, texels }
}

impl LightFiles for TestFiles {
    fn picture(&self, asset: &AssetRef) -> Result<LightPicture, String> {
        let name = &*asset.resolved;
        if let Some(at) = name.strip_prefix("texel ") {
            // One bright texel of 64 x 32.
            let (x, y) = at.split_once(' ').ok_or("two numbers")?;
            let parse = |text: &str| text.parse::<u32>().map_err(|error| error.to_string());
            let at = (parse(x)?, parse(y)?);
            return Ok(picture(64, 32, |x, y| if (x, y) == at { [100.0; 3] } else { [0.0; 3] }));
        }
        match name {
            "grey" => Ok(picture(16, 8, |_, _| [0.5; 3])),
            "halves" => {
                Ok(picture(64, 64, |x, y| [if x < 32 { 1.0 } else { 0.0 }, if y < 32 { 1.0 } else { 0.0 }, 0.25]))
            }
            "sky" => Ok(picture(128, 64, |x, y| {
                let sun = if (80..83).contains(&x) && (12..14).contains(&y) { 9.0e4 } else { 0.0 };
                #[expect(clippy::cast_precision_loss, reason = "a few texels")]
                let (x, y) = (x as f32, y as f32);
                [0.3 + 0.2 * (0.1 * x).sin() + sun, 0.4 + sun, 1.0 - y / 80.0 + sun]
            })),
            _ => Err("there is no such picture".into()),
        }
    }

    fn bytes(&self, asset: &AssetRef, _: u64) -> Result<Vec<u8>, String> {
        match &*asset.resolved {
            "cosine.ies" => {
                let angles: Vec<String> = (0..=180).map(|v| v.to_string()).collect();
                let values: Vec<String> =
                    (0..=180).map(|v| (2.0 * f64::from(v).to_radians().cos().max(0.0)).to_string()).collect();
                let text = format!(
                    "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 181 1 1 2 0 0 0\n1 1 0\n{}\n0\n{}\n",
                    angles.join(" "),
                    values.join(" ")
                );
                Ok(text.into_bytes())
            }
            "even.ies" => Ok(b"IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 2 1 1 2 0 0 0\n1 1 0\n0 180\n0\n3 3\n".to_vec()),
            _ => Err("there is no such file".into()),
        }
    }
}
