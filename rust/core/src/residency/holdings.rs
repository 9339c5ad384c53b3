// SPDX-License-Identifier: Apache-2.0
//! Who holds which asset: reference counts over the units that are loading or resident, and the bytes they come to.
//!
//! Also keeps, per unit, the bytes that only it holds (what its eviction would free) at constant cost per change: each
//! asset remembers the exclusive-or of its holders' ids, which is the holder's id when there is one.

use super::{AssetId, UnitCatalog, UnitId};

#[derive(Clone, Debug, Default)]
struct HeldAsset {
    holders: u32,
    holder_xor: u32,
    in_flight: bool,
    was_held: bool,
}

#[derive(Clone, Debug)]
pub(super) struct AssetHoldings {
    assets: Vec<HeldAsset>,
    exclusive: Vec<u64>,
    held: u64,
}

impl AssetHoldings {
    pub(super) fn new(catalog: &UnitCatalog) -> Self {
        Self {
            assets: vec![HeldAsset::default(); catalog.asset_count()],
            exclusive: vec![0; catalog.unit_count()],
            held: 0,
        }
    }

    /// Bytes of all held assets.
    pub(super) fn held(&self) -> u64 {
        self.held
    }

    /// Bytes that go when this unit goes.
    pub(super) fn exclusive(&self, unit: UnitId) -> u64 {
        self.exclusive[unit as usize]
    }

    pub(super) fn is_held(&self, asset: AssetId) -> bool {
        self.assets.get(asset as usize).is_some_and(|asset| asset.holders > 0)
    }

    /// Bytes the unit would add, `None` while one of its assets is on its way for another unit.
    pub(super) fn missing(&self, catalog: &UnitCatalog, unit: UnitId) -> Option<u64> {
        let mut bytes = 0;
        for &id in catalog.assets(unit) {
            let asset = &self.assets[id as usize];
            if asset.in_flight {
                return None;
            }
            if asset.holders == 0 {
                bytes += catalog.bytes(id);
            }
        }
        Some(bytes)
    }

    /// The unit becomes a holder of all its assets; `new` gets those nobody held. Not for a unit that holds them.
    pub(super) fn acquire(&mut self, catalog: &UnitCatalog, unit: UnitId, new: &mut Vec<AssetId>) {
        for &id in catalog.assets(unit) {
            let bytes = catalog.bytes(id);
            let asset = &mut self.assets[id as usize];
            match asset.holders {
                0 => {
                    self.held += bytes;
                    self.exclusive[unit as usize] += bytes;
                    new.push(id);
                }
                1 => self.exclusive[asset.holder_xor as usize] -= bytes,
                _ => {}
            }
            asset.holders += 1;
            asset.holder_xor ^= unit;
        }
    }

    /// Undoes [`Self::acquire`]; `freed` gets the assets nobody holds any more.
    pub(super) fn release(&mut self, catalog: &UnitCatalog, unit: UnitId, freed: &mut Vec<AssetId>) {
        for &id in catalog.assets(unit) {
            let bytes = catalog.bytes(id);
            let asset = &mut self.assets[id as usize];
            asset.holders -= 1;
            asset.holder_xor ^= unit;
            match asset.holders {
                0 => {
                    self.held -= bytes;
                    self.exclusive[unit as usize] -= bytes;
                    freed.push(id);
                }
                1 => self.exclusive[asset.holder_xor as usize] += bytes,
                _ => {}
            }
        }
    }

    pub(super) fn set_in_flight(&mut self, assets: &[AssetId], in_flight: bool) {
        for &id in assets {
            self.assets[id as usize].in_flight = in_flight;
        }
    }

    /// The assets are on the device now; returns the bytes of those that had been there before.
    pub(super) fn arrived(&mut self, catalog: &UnitCatalog, assets: &[AssetId]) -> u64 {
        let mut again = 0;
        for &id in assets {
            let asset = &mut self.assets[id as usize];
            asset.in_flight = false;
            if asset.was_held {
                again += catalog.bytes(id);
            }
            asset.was_held = true;
        }
        again
    }
}
