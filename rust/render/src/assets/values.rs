// SPDX-License-Identifier: Apache-2.0
//! Tables of values by instance: entries of the columns, one more that ends them, then the values of each column in the
//! order of the rows. Pure.

use oocpt_abi::{GpuAttribute, NO_NAME};
use oocpt_core::scene::InstanceColumn;

/// Alignment of every section, bytes.
pub(crate) const ALIGN: u64 = 16;

/// The byte offsets of the parts of a table.
#[derive(Debug)]
pub(crate) struct ValueLayout {
    /// Column, and offset of its values.
    pub(crate) columns: Vec<(InstanceColumn, u64)>,
    /// The end in bytes; 0 without columns.
    pub(crate) bytes: u64,
}

impl ValueLayout {
    /// The layout of a table of so many rows.
    pub(crate) fn new(columns: &[InstanceColumn], rows: usize) -> Self {
        if columns.is_empty() {
            return Self { columns: Vec::new(), bytes: 0 };
        }
        let mut bytes = ((columns.len() + 1) * size_of::<GpuAttribute>()) as u64;
        let place = |column: &InstanceColumn| {
            let at = bytes;
            bytes = (bytes + rows as u64 * 4 * u64::from(column.width)).next_multiple_of(ALIGN);
            (*column, at)
        };
        let columns = columns.iter().map(place).collect();
        Self { columns, bytes }
    }

    /// The entries at the beginning of the table.
    pub(crate) fn entries(&self) -> Vec<GpuAttribute> {
        let entry = |name, values, width: u32| GpuAttribute { values, name, rate_and_width: width << 8 };
        let entries = self.columns.iter().map(|(column, at)| entry(column.id, *at, column.width));
        entries.chain([entry(NO_NAME, 0, 0)]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn value_columns_are_contiguous_and_an_empty_table_is_empty() {
        assert_eq!(ValueLayout::new(&[], 100).bytes, 0);
        let columns = [InstanceColumn { id: 0, width: 3 }, InstanceColumn { id: 7, width: 1 }];
        let layout = ValueLayout::new(&columns, 3);
        // Three entries of 16 bytes, three times 12 bytes rounded up, three times 4.
        assert_eq!((layout.columns[0].1, layout.columns[1].1, layout.bytes), (48, 96, 112));
        let entries = layout.entries();
        assert_eq!(
            entries.iter().map(|e| (e.name, e.rate_and_width)).collect::<Vec<_>>(),
            [(0, 768), (7, 256), (NO_NAME, 0)]
        );
    }
}
