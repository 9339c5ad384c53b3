// SPDX-License-Identifier: Apache-2.0
//! tmp
mod host; mod places; mod process;
fn main() -> anyhow::Result<()> {
    let places = places::Places::from_env()?;
    let i = host::find_interpreter().unwrap();
    host::prepare(&places, &i)
}
