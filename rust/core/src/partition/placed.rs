// SPDX-License-Identifier: Apache-2.0
//! Values of instance-rate primvars at the placements of opened assemblies. Records of these are in no chunk, so their
//! values are in a table of the world, one row for each placement that has any. Pure.

use super::place::OpenedPlacement;
use crate::instancing::assembly::AssemblyMember;
use crate::instancing::instance_primvars::{ColumnReader, InstanceColumn};
use oocpt_abi::{NO_ROW, NO_VALUE};

/// A value of a placement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PlacedValue {
    column: InstanceColumn,
    value: [f32; 4],
}

impl PlacedValue {
    /// The number of its name, and all four components as materials see them: one is in all, else what is missing is 0,
    /// and alpha 1.
    pub(crate) fn expanded(&self) -> (u32, [f32; 4]) {
        let [x, y, z, w] = self.value;
        let value = match self.column.width {
            1 => [x; 4],
            2 => [x, y, 0.0, 1.0],
            3 => [x, y, z, 1.0],
            _ => [x, y, z, w],
        };
        (self.column.id, value)
    }
}

/// The table.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PlacedValues {
    /// Primvars of which there are values.
    pub columns: Vec<InstanceColumn>,
    /// By column: bits of floats, [`InstanceColumn::width`] for each row; [`NO_VALUE`] where a row has none.
    pub values: Vec<Vec<u32>>,
}

/// Reads what a member gives its placements.
pub(crate) struct PlacedReader<'a> {
    column: InstanceColumn,
    reader: ColumnReader<'a>,
}

impl<'a> PlacedReader<'a> {
    /// One for each primvar of the member.
    pub(crate) fn all_of(member: &'a AssemblyMember) -> Vec<Self> {
        let columns = member.primvars.iter().map(crate::instancing::instance_primvars::MemberPrimvar::column);
        let reader = |column| Some(Self { column, reader: ColumnReader::new(&member.run, &member.primvars, column)? });
        columns.filter_map(reader).collect()
    }

    /// The values of a placement inside one with the values `outer`.
    pub(crate) fn values(all: &[Self], outer: &[PlacedValue], rank: u32) -> Vec<PlacedValue> {
        let is_hidden = |value: &PlacedValue| all.iter().any(|inner| inner.column.id == value.column.id);
        let mut values: Vec<PlacedValue> = outer.iter().filter(|value| !is_hidden(value)).copied().collect();
        values.extend(all.iter().map(|inner| PlacedValue { column: inner.column, value: inner.reader.at(rank) }));
        values
    }
}

impl PlacedValues {
    /// The table of all placements that have values, which are told their rows.
    pub(crate) fn new(placements: &mut [Vec<OpenedPlacement>]) -> Self {
        let mut table = Self::default();
        for value in placements.iter().flatten().flat_map(|placement| &placement.values) {
            if !table.columns.contains(&value.column) {
                table.columns.push(value.column);
            }
        }
        table.columns.sort_unstable();
        table.values = vec![Vec::new(); table.columns.len()];
        let rows = placements.iter_mut().flatten().filter(|placement| !placement.values.is_empty());
        for (placement, row) in rows.zip(0..NO_ROW) {
            placement.row = row;
            for (column, values) in table.columns.iter().zip(&mut table.values) {
                let value = placement.values.iter().find(|value| value.column == *column);
                let bits = value.map_or([NO_VALUE; 4], |value| value.value.map(f32::to_bits));
                values.extend(bits.iter().take(column.width as usize));
            }
        }
        table
    }

    /// The values of a row; none of a row that is not there.
    pub(crate) fn row(&self, row: u32) -> Vec<PlacedValue> {
        let value = |column: &InstanceColumn, values: &Vec<u32>| {
            let width = column.width.max(1) as usize;
            let bits = values.get((row as usize).checked_mul(width)?..)?.get(..width)?;
            let mut value = [0.0; 4];
            value.iter_mut().zip(bits).for_each(|(value, bits)| *value = f32::from_bits(*bits));
            (bits.first() != Some(&NO_VALUE)).then_some(PlacedValue { column: *column, value })
        };
        self.columns.iter().zip(&self.values).filter_map(|(column, values)| value(column, values)).collect()
    }

    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        let first = self.columns.first().zip(self.values.first());
        first.map_or(0, |(column, values)| values.len() / column.width.max(1) as usize)
    }
}
