// SPDX-License-Identifier: Apache-2.0
//! Tables of measurements: `rust/book/measurements/NAME.json` is the source, pages hold what is generated from it
//! between `<!-- table: NAME -->` and `<!-- end of table -->`. Pure but for [`read_all`].

use std::collections::BTreeMap;
use std::fs;

use anyhow::{Context as _, Result, ensure};
use serde_json::Value;

use crate::places::RootFolders;

/// Folder of the sources.
const FOLDER: &str = "rust/book/measurements";
/// At the beginning of a line; elsewhere it is an example.
const BEGIN: &str = "\n<!-- table: ";
const END: &str = "<!-- end of table -->";

/// A table as it was measured.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct MeasuredTable {
    date: String,
    machine: String,
    command: String,
    note: String,
    columns: Vec<String>,
    rows: Vec<Vec<String>>,
}

/// All tables by name.
pub(super) type MeasuredTables = BTreeMap<String, MeasuredTable>;

/// Reads every source.
///
/// # Errors
/// If a source is no table, or a row has not as many cells as there are columns.
pub(super) fn read_all(places: &RootFolders) -> Result<MeasuredTables> {
    let folder = places.repo.join(FOLDER);
    let mut tables = MeasuredTables::new();
    for entry in fs::read_dir(&folder).with_context(|| format!("cannot list {FOLDER}"))? {
        let path = entry?.path();
        if path.extension().is_none_or(|extension| extension != "json") {
            continue;
        }
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let text = fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
        let table = parse(&text).with_context(|| format!("{FOLDER}/{name}.json"))?;
        tables.insert(name, table);
    }
    Ok(tables)
}

fn parse(text: &str) -> Result<MeasuredTable> {
    let value: Value = serde_json::from_str(text).context("no JSON")?;
    let word = |key: &str| -> Result<String> {
        let text = value[key].as_str().with_context(|| format!("no text under {key:?}"))?;
        Ok(text.to_owned())
    };
    let columns = cells(&value["columns"]).context("no \"columns\"")?;
    let rows = value["rows"].as_array().context("no \"rows\"")?;
    let rows: Vec<Vec<String>> = rows.iter().map(cells).collect::<Option<_>>().context("a row that is no list")?;
    for row in &rows {
        ensure!(row.len() == columns.len(), "a row of {} cells under {} columns: {row:?}", row.len(), columns.len());
    }
    let (date, machine, command) = (word("date")?, word("machine")?, word("command")?);
    Ok(MeasuredTable { date, machine, command, note: word("note")?, columns, rows })
}

/// The cells of a list of texts and numbers; numbers as they are written.
fn cells(list: &Value) -> Option<Vec<String>> {
    let cell = |value: &Value| match value {
        Value::String(text) => Some(text.clone()),
        Value::Number(number) => Some(number.to_string()),
        _ => None,
    };
    list.as_array()?.iter().map(cell).collect()
}

/// The page with the tables that it names, generated anew.
///
/// # Errors
/// If it names a table that there is none of, or does not end one.
pub(super) fn filled(page: &str, tables: &MeasuredTables) -> Result<String> {
    let mut made = String::new();
    let mut rest = page;
    while let Some((before, after)) = rest.split_once(BEGIN) {
        let (name, after) = after.split_once(" -->\n").context("a table's mark without an end")?;
        let (_, after) = after.split_once(END).with_context(|| format!("table {name} is not ended by {END}"))?;
        let table = tables.get(name).with_context(|| format!("there is no {FOLDER}/{name}.json"))?;
        made.extend([before, BEGIN, name, " -->\n", &markdown(table), END]);
        rest = after;
    }
    made.push_str(rest);
    Ok(made)
}

/// The table, and below it where it comes from.
fn markdown(table: &MeasuredTable) -> String {
    let row = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let mut text = String::from("\n") + &row(&table.columns) + &row(&vec!["---".to_owned(); table.columns.len()]);
    text.extend(table.rows.iter().map(|cells| row(cells)));
    let command = if table.command.is_empty() { String::new() } else { format!(" Command: `{}`.", table.command) };
    let note = if table.note.is_empty() { String::new() } else { format!(" {}", table.note) };
    let source = format!("{}, {}.{command}{note}", table.machine, table.date);
    text + "\n" + &wrapped(source.trim_start_matches([',', ' '])) + "\n"
}

/// The text in lines of at most 120 columns.
fn wrapped(text: &str) -> String {
    let mut lines = String::new();
    let mut length = 0;
    for word in text.split_whitespace() {
        let columns = word.chars().count();
        if length > 0 && length + 1 + columns > super::COLUMNS {
            lines.push('\n');
            length = 0;
        } else if length > 0 {
            lines.push(' ');
            length += 1;
        }
        lines.push_str(word);
        length += columns;
    }
    lines + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOURCE: &str = r#"{"date": "2026-11-22", "machine": "a GPU", "command": "oocpt bench", "note": "",
        "columns": ["a", "b"], "rows": [["x", 1.5], ["y", 2]]}"#;

    fn tables() -> MeasuredTables {
        MeasuredTables::from([("t".to_owned(), parse(SOURCE).unwrap())])
    }

    #[test]
    fn a_generated_table_replaces_the_old_one() {
        let made = filled("before\n<!-- table: t -->\nold\n<!-- end of table -->\nafter\n", &tables()).unwrap();
        let table =
            "\n| a | b |\n| --- | --- |\n| x | 1.5 |\n| y | 2 |\n\na GPU, 2026-11-22. Command: `oocpt bench`.\n\n";
        assert_eq!(made, format!("before\n<!-- table: t -->\n{table}<!-- end of table -->\nafter\n"), "generated");
        assert_eq!(filled(&made, &tables()).unwrap(), made, "generating again changes nothing");
    }

    #[test]
    fn malformed_tables_are_reported() {
        assert!(filled("\n<!-- table: u -->\n<!-- end of table -->", &tables()).is_err(), "a table that is not there");
        assert!(filled("\n<!-- table: t -->\n| a |", &tables()).is_err(), "no end");
        assert!(filled("    <!-- table: u -->\n", &tables()).is_ok(), "an example");
        assert!(parse(&SOURCE.replace(r#", "b"]"#, "]")).is_err(), "fewer columns than cells");
        assert!(parse(&SOURCE.replace(r#""date""#, r#""day""#)).is_err(), "no date");
    }
}
