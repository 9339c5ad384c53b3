// SPDX-License-Identifier: Apache-2.0
//! Writes the BSDF's tables that are part of the program, `src/bsdf_tables/NAME.bin`, anew: `cargo run --profile fast
//! -p oocpt-render --example bsdf_tables [NAME]`. Some minutes; tests compare what is there with what is computed.

use oocpt_render::bsdf_tables::{self, glass, sheen};
use std::{env, fs, io, path::Path};

/// A name, and what computes its bytes.
type Table = (&'static str, fn() -> Vec<u8>);

fn main() -> io::Result<()> {
    let only = env::args().nth(1);
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/bsdf_tables");
    let tables: [Table; 3] = [
        ("ggx", bsdf_tables::compute),
        ("sheen", sheen::compute),
        ("glass", || glass::make::GlassLosses::compute().bytes()),
    ];
    for (name, compute) in tables {
        if only.as_deref().is_none_or(|only| only == name) {
            fs::write(folder.join(format!("{name}.bin")), compute())?;
        }
    }
    Ok(())
}
