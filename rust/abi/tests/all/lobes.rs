// SPDX-License-Identifier: Apache-2.0
//! The table of lobes: orders name existing lobes, once each, and every lobe is in every order.

use oocpt_abi::{Features, LOBE_ALONE, LOBES, LOBES_ADDED, LOBES_EVALUATED, lobes_in_order};
use std::collections::BTreeSet;

#[test]
fn every_lobe_order_lists_each_lobe_once() {
    let all: BTreeSet<&str> = LOBES.iter().map(|lobe| lobe.name).collect();
    assert_eq!(all.len(), LOBES.len(), "names are unique");
    for order in [LOBES_ADDED, LOBES_EVALUATED] {
        let named: BTreeSet<&str> = order.iter().copied().collect();
        assert!(named.len() == order.len() && named.is_subset(&all), "{order:?}");
        let whole: Vec<&str> = lobes_in_order(order).iter().map(|lobe| lobe.name).collect();
        assert_eq!(whole.iter().copied().collect::<BTreeSet<_>>(), all, "{order:?}");
        assert_eq!((whole.len(), &whole[..order.len()]), (all.len(), order), "those that are named come first");
    }
}

#[test]
fn only_the_lobe_of_plain_surfaces_is_always_compiled() {
    let always: Vec<&str> = LOBES.iter().filter(|lobe| lobe.needs == Features::empty()).map(|lobe| lobe.name).collect();
    assert_eq!(always, [LOBE_ALONE]);
}
