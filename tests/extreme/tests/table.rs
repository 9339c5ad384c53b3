// SPDX-License-Identifier: Apache-2.0
//! The table on the device that `OOCPT_TEST_DEVICE` names, with the validation layer on. `OOCPT_EXTREME_FULL=1`: with
//! all rays.
#![forbid(unsafe_code)]

use oocpt_extreme::{Options, run};

#[test]
fn every_bound_holds_or_is_explained() {
    let table = run(&Options {
        device: std::env::var("OOCPT_TEST_DEVICE").unwrap_or_default(),
        validation: true,
        full: std::env::var_os("OOCPT_EXTREME_FULL").is_some(),
        filter: std::env::var("OOCPT_EXTREME_FILTER").ok(),
    });
    println!("{}", table.text());
    let unexpected: Vec<_> = table.unexpected().collect();
    assert!(unexpected.is_empty(), "{unexpected:#?}");
}
