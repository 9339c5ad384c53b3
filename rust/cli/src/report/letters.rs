// SPDX-License-Identifier: Apache-2.0
//! The font of charts and legends, which is part of the program, so that pictures are the same everywhere.

use anyhow::{Result, anyhow};
use image::RgbImage;
use plotters::prelude::*;
use plotters::style::register_font;

/// The name under which [`register`] registers the font.
pub(super) const FONT: &str = "monospace";
/// Pixels from a letter to the next at [`SIZE`].
pub(super) const ADVANCE: u32 = 8;
/// Size of the font, pixels.
const SIZE: i32 = 13;

/// Registers Hack (<https://sourcefoundry.org/hack/>, MIT and Bitstream Vera licences) with plotters. Repeated calls do
/// no harm.
pub(super) fn register() -> Result<()> {
    register_font(FONT, FontStyle::Normal, epaint_default_fonts::HACK_REGULAR)
        .map_err(|_invalid| anyhow!("a broken font"))
}

/// Writes text; `left` and `top` in pixels.
pub(super) fn write(image: &mut RgbImage, left: u32, top: u32, text: &str) -> Result<()> {
    register()?;
    let size = image.dimensions();
    let at = (i32::try_from(left)?, i32::try_from(top)?);
    let area = BitMapBackend::with_buffer(image, size).into_drawing_area();
    area.draw(&Text::new(text, at, (FONT, SIZE).into_font().color(&RGBColor(230, 230, 230))))?;
    area.present()?;
    Ok(())
}
