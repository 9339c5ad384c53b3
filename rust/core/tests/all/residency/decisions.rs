// SPDX-License-Identifier: Apache-2.0
//! Small cases with known answers.

use oocpt_core::residency::{Catalog, Command, Demand, PlanError, Planner, PlannerOptions, PolicyKind};
use std::sync::Arc;

/// Units 0..4, each with a block of 10 bytes; 0 and 1 share a mesh of 50, 2 has its own of 50.
fn catalog() -> Arc<Catalog> {
    let bytes = vec![10, 10, 10, 10, 50, 50];
    Arc::new(Catalog::new(bytes, [vec![0, 4], vec![1, 4], vec![2, 5], vec![3]]).expect("a good catalog"))
}

fn waiting(waiting: &[u32]) -> Demand<'_> {
    Demand { waiting, active: 1000, ..Demand::default() }
}

fn load(unit: u32, assets: &[u32]) -> Command {
    Command::Load { unit, assets: assets.to_vec() }
}

fn evict(unit: u32, assets: &[u32]) -> Command {
    Command::Evict { unit, assets: assets.to_vec() }
}

#[test]
fn a_shared_mesh_is_loaded_once_and_freed_with_its_last_unit() {
    for kind in PolicyKind::ALL {
        let mut planner = Planner::new(catalog(), 70, kind).unwrap();
        assert_eq!(planner.step(&waiting(&[5])), [load(0, &[0, 4])], "{kind}");
        assert_eq!(planner.step(&waiting(&[5, 5])), [], "{kind}: mesh 4 is on its way");
        planner.loaded(0);
        assert_eq!(planner.step(&waiting(&[0, 5])), [load(1, &[1])], "{kind}");
        planner.loaded(1);
        assert_eq!(planner.stats().bytes_held, 70, "{kind}");
        let mut commands = Vec::new();
        for _ in 0..4 {
            commands.extend(planner.step(&waiting(&[0, 0, 50])));
        }
        assert_eq!(commands, [evict(0, &[0]), evict(1, &[1, 4]), load(2, &[2, 5])], "{kind}");
    }
}

#[test]
fn a_declined_load_is_proposed_again() {
    for kind in PolicyKind::ALL {
        let mut planner = Planner::new(catalog(), 120, kind).unwrap();
        let mut asked = Vec::new();
        for _ in 0..200 {
            asked.clear();
            let commands = planner.step_if(&waiting(&[5, 0, 9, 0]), &mut |proposal| {
                asked.push((proposal.unit, proposal.bytes));
                proposal.unit != 2
            });
            assert!(!commands.contains(&load(2, &[2, 5])), "{kind}: refused");
            planner.loaded(0);
        }
        assert!(
            planner.is_resident(0) && asked.contains(&(2, 60)),
            "{kind}: others are loaded, it is asked: {asked:?}"
        );
        assert_eq!(planner.step(&waiting(&[0, 0, 9])), [load(2, &[2, 5])], "{kind}: agreed to");
    }
}

#[test]
fn a_unit_that_never_fits_is_an_error() {
    let refused = Planner::new(catalog(), 59, PolicyKind::Benefit).map(|_| ());
    assert_eq!(refused, Err(PlanError::TooLarge { units: [Some(0), None], bytes: 60, budget: 59 }), "59 of 60");
    assert!(Planner::new(catalog(), 60, PolicyKind::Benefit).is_ok(), "60 of 60");
}

#[test]
fn many_small_units_come_in_one_step() {
    for kind in PolicyKind::ALL {
        let (count, small) = (3000, 64 << 10);
        let bytes = |bytes: u64| Arc::new(Catalog::new(vec![bytes; 3000], (0..count).map(|i| vec![i])).expect("good"));
        let loads = |bytes_each: u64| {
            let options = PlannerOptions { in_flight_bytes: 1 << 40, ..PlannerOptions::default() };
            let catalog = bytes(bytes_each);
            let mut planner = Planner::with_policy(catalog, 1 << 40, kind.policy(), options).unwrap();
            planner.step(&waiting(&[7; 3000])).len()
        };
        assert_eq!(loads(small), 3000, "{kind}: tiles");
        assert!((1..=256).contains(&loads(small * 64)), "{kind}: units");
    }
}

/// `count` units by `row`, every asset of one byte.
pub(crate) fn catalog_of(count: u32, row: impl Fn(u32) -> Vec<u32>, meshes: u32) -> Arc<Catalog> {
    Arc::new(Catalog::new(vec![1; (count + meshes) as usize], (0..count).map(row)).expect("a good catalog"))
}

pub(crate) fn planner(catalog: &Arc<Catalog>, budget: u64, kind: PolicyKind) -> Planner {
    Planner::new(catalog.clone(), budget, kind).expect("the budget fits the largest unit")
}
