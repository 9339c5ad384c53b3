// SPDX-License-Identifier: Apache-2.0
//! The catalog of everything that can be loaded: the bytes of each asset, and the assets of each unit. Immutable,
//! shared by planners.

use super::{AssetId, UnitId};
use std::ops::Range;

/// Bytes per asset and assets per unit (compressed rows). Every unit's own block is an asset.
#[derive(Clone, Debug, Default)]
pub struct UnitCatalog {
    bytes: Vec<u64>,
    starts: Vec<usize>,
    assets: Vec<AssetId>,
    closures: Vec<u64>,
    total: u64,
    bases: usize,
    /// First of the units that stand alone: those before are bases, or need a base, if there are bases.
    in_pairs: usize,
}

/// Reason why a catalog was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CatalogError {
    /// A unit names an asset that has no bytes.
    #[error("unit {unit} names asset {asset}, there are {count}")]
    UnknownAsset {
        /// The unit.
        unit: UnitId,
        /// Asset that the unit names.
        asset: AssetId,
        /// Number of assets in the catalog.
        count: usize,
    },
    /// There are more than 2^32 - 1 units or assets.
    #[error("{0} units or assets are more than ids can name")]
    TooMany(usize),
    /// The sum of all bytes does not fit 64 bits.
    #[error("the sizes add up to more than 2^64 bytes")]
    Overflow,
}

impl UnitCatalog {
    /// Creates a catalog of `bytes[asset]` and the assets of every unit in order; an asset named twice by a unit counts
    /// once.
    pub fn new<I>(bytes: Vec<u64>, units: I) -> Result<Self, CatalogError>
    where
        I: IntoIterator,
        I::Item: AsRef<[AssetId]>,
    {
        id_count(bytes.len())?;
        let mut total = 0_u64;
        for &size in &bytes {
            total = total.checked_add(size).ok_or(CatalogError::Overflow)?;
        }
        let mut catalog =
            Self { bytes, starts: vec![0], assets: Vec::new(), closures: Vec::new(), total, bases: 0, in_pairs: 0 };
        for row in units {
            catalog.push(row.as_ref())?;
        }
        Ok(catalog)
    }

    /// Makes the first `count` units *bases*: a ray that waits for any other of the present units may need one of them
    /// at the same time. Units that are added later stand alone, such as tiles of textures.
    #[must_use]
    pub fn with_bases(self, count: usize) -> Self {
        let in_pairs = self.closures.len();
        Self { bases: count.min(in_pairs), in_pairs, ..self }
    }

    /// Adds `bytes.len()` assets, and for each a unit that consists of it alone.
    pub fn push_singles(&mut self, bytes: &[u64]) -> Result<(), CatalogError> {
        id_count(self.closures.len() + bytes.len())?;
        let first = self.bytes.len();
        id_count(first + bytes.len())?;
        let total = bytes.iter().try_fold(self.total, |total, size| total.checked_add(*size));
        self.total = total.ok_or(CatalogError::Overflow)?;
        let (start, end) = (self.assets.len() + 1, self.assets.len() + bytes.len());
        self.bytes.extend_from_slice(bytes);
        self.closures.extend_from_slice(bytes);
        // Counted above.
        self.assets.extend((first..first + bytes.len()).map(|asset| AssetId::try_from(asset).unwrap_or(AssetId::MAX)));
        self.starts.extend(start..=end);
        Ok(())
    }

    /// Gives an asset another size. `unit`: the one unit that has it, if one has.
    pub fn resize(&mut self, asset: AssetId, unit: Option<UnitId>, bytes: u64) {
        let Some(held) = self.bytes.get_mut(asset as usize) else { return };
        let before = std::mem::replace(held, bytes);
        let resized = |sum: u64| sum.saturating_sub(before).saturating_add(bytes);
        self.total = resized(self.total);
        if let Some(closure) = unit.and_then(|unit| self.closures.get_mut(unit as usize)) {
            *closure = resized(*closure);
        }
    }

    fn push(&mut self, row: &[AssetId]) -> Result<(), CatalogError> {
        let unit = id_count(self.closures.len() + 1)?;
        let start = self.assets.len();
        for &asset in row {
            if asset as usize >= self.bytes.len() {
                return Err(CatalogError::UnknownAsset { unit, asset, count: self.bytes.len() });
            }
            self.assets.push(asset);
        }
        let row = &mut self.assets[start..];
        row.sort_unstable();
        let mut kept = 0;
        for i in 0..row.len() {
            if kept == 0 || row[kept - 1] != row[i] {
                row[kept] = row[i];
                kept += 1;
            }
        }
        self.assets.truncate(start + kept);
        // Distinct assets of a sum that fits 64 bits.
        self.closures.push(self.assets[start..].iter().map(|&asset| self.bytes[asset as usize]).sum());
        self.starts.push(self.assets.len());
        Ok(())
    }

    /// Number of units.
    pub fn unit_count(&self) -> usize {
        self.closures.len()
    }

    /// Number of assets.
    pub fn asset_count(&self) -> usize {
        self.bytes.len()
    }

    /// Device bytes of an asset, 0 for an unknown one.
    pub fn bytes(&self, asset: AssetId) -> u64 {
        self.bytes.get(asset as usize).copied().unwrap_or(0)
    }

    /// The unit's assets, sorted, each once; none for an unknown unit.
    pub fn assets(&self, unit: UnitId) -> &[AssetId] {
        let unit = unit as usize;
        match (self.starts.get(unit), self.starts.get(unit + 1)) {
            (Some(&start), Some(&end)) => &self.assets[start..end],
            _ => &[],
        }
    }

    /// Device bytes of the unit with all its assets.
    pub fn closure_bytes(&self, unit: UnitId) -> u64 {
        self.closures.get(unit as usize).copied().unwrap_or(0)
    }

    /// The largest set of units that rays need at once (a base with another unit, or a unit that stands alone), and its
    /// bytes; the first of equals.
    pub fn largest(&self) -> ([Option<UnitId>; 2], u64) {
        let largest = |units: Range<usize>| {
            let closures = (0..).zip(&self.closures).skip(units.start).take(units.len());
            closures.fold((None, 0), |(best, most), (unit, &bytes)| match best {
                Some(_) if most >= bytes => (best, most),
                _ => (Some(unit), bytes),
            })
        };
        let in_pairs = self.bases..self.in_pairs.max(self.bases);
        let alone = largest(in_pairs.end..self.closures.len());
        let (base, other) = (largest(0..self.bases), largest(in_pairs));
        let pair = base.1.saturating_add(other.1);
        if alone.1 > pair { ([alone.0, None], alone.1) } else { ([base.0, other.0], pair) }
    }

    /// Bytes of [`Self::largest`]: with a smaller budget, some ray could never continue.
    pub fn least_budget(&self) -> u64 {
        self.largest().1
    }

    /// Bytes of all assets.
    pub fn total_bytes(&self) -> u64 {
        self.total
    }
}

/// The last id of `count` items, an error if ids do not reach.
fn id_count(count: usize) -> Result<u32, CatalogError> {
    u32::try_from(count).map(|count| count.saturating_sub(1)).map_err(|_out_of_range| CatalogError::TooMany(count))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tiles of textures are added so: as if each had been named as a row.
    #[test]
    fn single_asset_units_form_catalog_rows() {
        let rows: [&[AssetId]; 3] = [&[0, 1], &[1], &[]];
        let mut added = UnitCatalog::new(vec![10, 20], rows).expect("sound");
        added.push_singles(&[5, 0, 7]).expect("small");
        let whole: [&[AssetId]; 6] = [&[0, 1], &[1], &[], &[2], &[3], &[4]];
        let named = UnitCatalog::new(vec![10, 20, 5, 0, 7], whole).expect("sound");
        assert_eq!((added.unit_count(), added.asset_count(), added.total_bytes()), (6, 5, 42));
        for unit in 0..7 {
            assert_eq!(added.assets(unit), named.assets(unit), "unit {unit}");
            assert_eq!(added.closure_bytes(unit), named.closure_bytes(unit), "unit {unit}");
        }
        assert_eq!((0..6).map(|asset| added.bytes(asset)).sum::<u64>(), 42);
        assert_eq!(added.largest(), named.largest());
        added.push_singles(&[]).expect("nothing");
        assert_eq!(added.unit_count(), 6, "nothing more");
    }

    #[test]
    fn the_least_budget_holds_a_base_beside_another_unit_or_one_that_stands_alone() {
        let catalog = || UnitCatalog::new(vec![10, 20, 7, 40], [vec![0], vec![1], vec![2], vec![3]]).expect("sound");
        assert_eq!(catalog().largest(), ([Some(3), None], 40), "no pairs");
        let least = |bases: usize| catalog().with_bases(bases).largest();
        assert_eq!(least(0), ([None, Some(3)], 40), "no bases");
        assert_eq!(least(3), ([Some(1), Some(3)], 60), "three");
        assert_eq!(least(9), ([Some(3), None], 40), "all");
        let with_tile = |bytes: u64| {
            let mut catalog = catalog().with_bases(3);
            catalog.push_singles(&[bytes]).expect("small");
            (catalog.largest(), catalog.least_budget())
        };
        assert_eq!(with_tile(60), (([Some(1), Some(3)], 60), 60), "a tile needs no base beside it");
        assert_eq!(with_tile(61), (([Some(4), None], 61), 61), "but room for itself");
    }

    #[test]
    fn too_many_single_units_are_refused_atomically() {
        let mut catalog = UnitCatalog::new(vec![u64::MAX - 10], [[0]]).expect("it fits");
        assert_eq!(catalog.push_singles(&[4, 7]), Err(CatalogError::Overflow));
        assert_eq!((catalog.unit_count(), catalog.asset_count()), (1, 1), "no asset was added");
        assert_eq!(catalog.total_bytes(), u64::MAX - 10, "nor its bytes");
    }
}
