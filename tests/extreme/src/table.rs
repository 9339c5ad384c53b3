// SPDX-License-Identifier: Apache-2.0
//! What the cases found: one row per quantity, one table per run, as text and as JSON.

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

/// One quantity of one case. All of it comes from the run but the bounds, which the case states.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Case, `group/name`.
    pub case: String,
    /// What was measured, with its unit.
    pub quantity: String,
    /// What it should be.
    pub reference: f64,
    /// What it is.
    pub got: f64,
    /// How far off it is, in the quantity's own measure.
    pub error: f64,
    /// What the error may be.
    pub bound: f64,
    /// What it may be all the same, where the bound is known not to hold; [`Row::note`] says why.
    pub known: Option<f64>,
    /// Why the bound does not hold, or what is special.
    pub note: String,
}

/// All rows of one run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Table {
    /// The device that rendered.
    pub device: String,
    /// Rows in the order of the cases.
    pub rows: Vec<Row>,
}

impl Row {
    /// Whether the bound holds. NaN never does.
    #[must_use]
    pub fn is_met(&self) -> bool {
        self.error <= self.bound
    }

    /// Whether the row is as it is known to be: the bound holds, or a miss that is explained is no worse than it was.
    #[must_use]
    pub fn is_expected(&self) -> bool {
        self.is_met() || (!self.note.is_empty() && self.known.is_some_and(|known| self.error <= known))
    }
}

impl Table {
    /// Rows that are neither good nor explained.
    pub fn unexpected(&self) -> impl Iterator<Item = &Row> {
        self.rows.iter().filter(|row| !row.is_expected())
    }

    /// The table as text.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = format!("device: {}\n", self.device);
        let widest = |of: fn(&Row) -> usize| self.rows.iter().map(of).max().unwrap_or(0);
        let (case, quantity) = (widest(|r| r.case.chars().count()).max(4), widest(|r| r.quantity.chars().count()));
        let quantity = quantity.max(8);
        let head = ["reference", "got", "error", "bound"].map(|name| format!("{name:>13}")).join(" ");
        line(&mut text, format_args!("{:<case$}  {:<quantity$} {head}", "case", "quantity"));
        for row in &self.rows {
            let numbers =
                [row.reference, row.got, row.error, row.bound].map(|n| format!("{:>13}", number(n))).join(" ");
            let verdict = if row.is_met() {
                "ok"
            } else if row.is_expected() {
                "MISSED (known)"
            } else {
                "MISSED"
            };
            let note = if row.note.is_empty() { String::new() } else { format!(": {}", row.note) };
            line(
                &mut text,
                format_args!("{:<case$}  {:<quantity$} {numbers}  {verdict}{note}", row.case, row.quantity),
            );
        }
        let met = self.rows.iter().filter(|row| row.is_met()).count();
        let unexpected = self.unexpected().count();
        let known = self.rows.len() - met - unexpected;
        line(
            &mut text,
            format_args!("{} rows: {met} ok, {known} missed and explained, {unexpected} missed", self.rows.len()),
        );
        text
    }

    /// How another device's table differs: rows of which `got` differs by more than `tolerance`, relative, or that only
    /// one has.
    #[must_use]
    pub fn against(&self, other: &Self, tolerance: f64) -> String {
        let mut text = format!("{}  against  {}\n", self.device, other.device);
        let mut same = 0;
        for row in &self.rows {
            let twin = other.rows.iter().find(|twin| twin.case == row.case && twin.quantity == row.quantity);
            let Some(twin) = twin else {
                line(&mut text, format_args!("{}, {}: only in the first", row.case, row.quantity));
                continue;
            };
            let scale = row.got.abs().max(twin.got.abs()).max(row.bound.min(1.0) * tolerance).max(f64::MIN_POSITIVE);
            let difference = (row.got - twin.got).abs();
            // NaN differs.
            if difference <= tolerance * scale {
                same += 1;
            } else {
                let verdicts = if row.is_met() == twin.is_met() { "" } else { "  VERDICTS DIFFER" };
                let numbers = [row.got, twin.got, row.error, twin.error].map(number).join("  ");
                line(
                    &mut text,
                    format_args!("{}, {}: got, got, error, error: {numbers}{verdicts}", row.case, row.quantity),
                );
            }
        }
        for row in &other.rows {
            if !self.rows.iter().any(|twin| twin.case == row.case && twin.quantity == row.quantity) {
                line(&mut text, format_args!("{}, {}: only in the second", row.case, row.quantity));
            }
        }
        line(&mut text, format_args!("{same} rows agree to {tolerance:e}"));
        text
    }
}

fn line(text: &mut String, arguments: std::fmt::Arguments<'_>) {
    // Writing to a string does not fail.
    text.write_fmt(arguments).unwrap_or_default();
    text.push('\n');
}

/// Six digits, short.
fn number(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let size = value.abs();
    if (1e-3..1e7).contains(&size) {
        let text = format!("{value:.6}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        format!("{value:.4e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(error: f64, known: Option<f64>, note: &str) -> Row {
        let (case, quantity) = ("a/b".to_owned(), "q".to_owned());
        Row { case, quantity, reference: 1.0, got: 1.0 + error, error, bound: 0.1, known, note: note.to_owned() }
    }

    #[test]
    fn a_miss_has_to_be_known_and_explained() {
        assert!(row(0.1, None, "").is_expected(), "on the bound is inside");
        for bad in [row(0.2, None, "why"), row(0.2, Some(0.3), ""), row(0.4, Some(0.3), "why"), row(f64::NAN, None, "")]
        {
            assert!(!bad.is_expected() && !bad.is_met(), "{bad:?}");
        }
        let known = row(0.2, Some(0.3), "why");
        assert!(known.is_expected() && !known.is_met(), "stays in the table as a miss");
        let table = Table { device: "d".into(), rows: vec![known, row(0.0, None, "")] };
        let text = table.text();
        assert!(
            text.contains("MISSED (known): why") && text.contains("1 ok, 1 missed and explained, 0 missed"),
            "{text}"
        );
    }

    #[test]
    fn tables_of_two_devices_are_compared_row_by_row() {
        let table = |got: f64| Table { device: "d".into(), rows: vec![row(got, None, "")] };
        assert!(table(0.01).against(&table(0.01), 1e-3).contains("1 rows agree"), "equal");
        let text = table(0.01).against(&table(0.2), 1e-3);
        assert!(text.contains("VERDICTS DIFFER") && text.contains("0 rows agree"), "{text}");
        let text = table(0.0).against(&Table::default(), 1e-3);
        assert!(text.contains("only in the first"), "{text}");
    }
}
