// SPDX-License-Identifier: Apache-2.0
//! Small cases with known answers.

use oocpt_core::residency::{
    PlanError, PlannerOptions, PolicyKind, RayDemand, ResidencyCommand, ResidencyPlanner, UnitCatalog,
};
use std::sync::Arc;

/// Units 0..4, each with a block of 10 bytes; 0 and 1 share a mesh of 50, 2 has its own of 50.
fn catalog() -> Arc<UnitCatalog> {
    let bytes = vec![10, 10, 10, 10, 50, 50];
    Arc::new(UnitCatalog::new(bytes, [vec![0, 4], vec![1, 4], vec![2, 5], vec![3]]).expect("a good catalog"))
}

fn waiting(waiting: &[u32]) -> RayDemand<'_> {
    RayDemand { waiting, active: 1000, ..RayDemand::default() }
}

fn load(unit: u32, assets: &[u32]) -> ResidencyCommand {
    ResidencyCommand::Load { unit, assets: assets.to_vec() }
}

fn evict(unit: u32, assets: &[u32]) -> ResidencyCommand {
    ResidencyCommand::Evict { unit, assets: assets.to_vec() }
}

#[test]
fn a_shared_mesh_is_loaded_once_and_freed_with_its_last_unit() {
    for kind in PolicyKind::ALL {
        let mut planner = ResidencyPlanner::new(catalog(), 70, kind).unwrap();
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
        let mut planner = ResidencyPlanner::new(catalog(), 120, kind).unwrap();
        let mut requested = Vec::new();
        for _ in 0..200 {
            requested.clear();
            let commands = planner.step_if(&waiting(&[5, 0, 9, 0]), &mut |proposal| {
                requested.push((proposal.unit, proposal.bytes));
                proposal.unit != 2
            });
            assert!(!commands.contains(&load(2, &[2, 5])), "{kind}: refused");
            planner.loaded(0);
        }
        assert!(
            planner.is_resident(0) && requested.contains(&(2, 60)),
            "{kind}: others are loaded, it is asked: {requested:?}"
        );
        assert_eq!(planner.step(&waiting(&[0, 0, 9])), [load(2, &[2, 5])], "{kind}: agreed to");
    }
}

#[test]
fn a_unit_that_never_fits_is_an_error() {
    let refused = ResidencyPlanner::new(catalog(), 59, PolicyKind::Benefit).map(|_| ());
    assert_eq!(refused, Err(PlanError::TooLarge { units: [Some(0), None], bytes: 60, budget: 59 }), "59 of 60");
    assert!(ResidencyPlanner::new(catalog(), 60, PolicyKind::Benefit).is_ok(), "60 of 60");
}

#[test]
fn many_small_units_come_in_one_step() {
    for kind in PolicyKind::ALL {
        let (count, small) = (3000, 64 << 10);
        let bytes =
            |bytes: u64| Arc::new(UnitCatalog::new(vec![bytes; 3000], (0..count).map(|i| vec![i])).expect("good"));
        let loads = |bytes_each: u64| {
            let options = PlannerOptions { in_flight_bytes: 1 << 40, ..PlannerOptions::default() };
            let catalog = bytes(bytes_each);
            let mut planner = ResidencyPlanner::with_policy(catalog, 1 << 40, kind.policy(), options).unwrap();
            planner.step(&waiting(&[7; 3000])).len()
        };
        assert_eq!(loads(small), 3000, "{kind}: tiles");
        assert!((1..=256).contains(&loads(small * 64)), "{kind}: units");
    }
}

/// `count` units by `row`, every asset of one byte.
pub(crate) fn catalog_of(count: u32, row: impl Fn(u32) -> Vec<u32>, meshes: u32) -> Arc<UnitCatalog> {
    Arc::new(UnitCatalog::new(vec![1; (count + meshes) as usize], (0..count).map(row)).expect("a good catalog"))
}

pub(crate) fn planner(catalog: &Arc<UnitCatalog>, budget: u64, kind: PolicyKind) -> ResidencyPlanner {
    ResidencyPlanner::new(catalog.clone(), budget, kind).expect("the budget fits the largest unit")
}
