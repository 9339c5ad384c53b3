// SPDX-License-Identifier: Apache-2.0
//! What the benches of budgets share: one session whose scene is rendered in core and under budgets, each under some
//! policies. A budget may be too small for the largest chunk; such a row fails by itself, and the bench at its end.

use anyhow::{Result, bail, ensure};
use oocpt_core::settings::SettingValue;
use oocpt_render::Session;
use serde::Serialize;

/// A row that did not render.
#[derive(Debug, Serialize)]
pub(crate) struct Failed {
    budget_percent: f64,
    policy: String,
    message: String,
}

/// Rows as they came, and those that did not.
pub(crate) type Rows<Row> = (Vec<Row>, Vec<Failed>);

/// Asserts what the benches take: numbers above 0, in core first.
pub(crate) fn check(budgets: &[f64]) -> Result<()> {
    ensure!(budgets.first().is_some_and(|&p| p >= 100.0), "--budgets: the first one has to be 100");
    ensure!(budgets.iter().all(|&p| p > 0.0), "--budgets: only numbers above 0");
    Ok(())
}

/// Sets what holds for all rows: all device memory in MiB and the size of chunks in KiB, each as it is by itself where
/// it is 0.
pub(crate) fn limit(session: &Session, memory_mib: u32, chunk_kib: u32) -> Result<()> {
    session.set_setting("oocpt:memoryBudget", SettingValue::Int(memory_mib.into()))?;
    if chunk_kib > 0 {
        session.set_setting("oocpt:chunkSize", SettingValue::Int(chunk_kib.into()))?;
    }
    Ok(())
}

/// Sets a row's budget, `percent` of `bytes`, and its policy, if it has one; gives the budget in KiB.
pub(crate) fn set(session: &Session, percent: f64, bytes: u64, policy: &str) -> Result<u32> {
    let budget = budget_kib(percent, bytes);
    session.set_setting("oocpt:geometryBudget", SettingValue::Int(budget.into()))?;
    if !policy.is_empty() {
        session.set_setting("oocpt:policy", SettingValue::Text(policy.into()))?;
    }
    Ok(budget)
}

/// Measures the row of every budget under every policy and prints it; `measure` is told the first row too, once there
/// is one.
pub(crate) fn each<Row>(
    budgets: &[f64],
    policies: &[String],
    mut measure: impl FnMut(f64, &str, Option<&Row>) -> Result<Row>,
    print: impl Fn(&Row),
) -> Rows<Row> {
    let (mut rows, mut failed) = (Vec::new(), Vec::new());
    for (budget_percent, policy) in budget_rows(budgets, policies) {
        match measure(budget_percent, &policy, rows.first()) {
            Ok(row) => {
                print(&row);
                rows.push(row);
            }
            Err(error) => {
                let message = format!("{error:#}");
                println!("{budget_percent:>7} {policy}: {message}");
                failed.push(Failed { budget_percent, policy, message });
            }
        }
    }
    (rows, failed)
}

/// The end of a bench: an error if pictures differ or rows failed.
pub(crate) fn verdict(all_identical: bool, rendered: usize, failed: &[Failed]) -> Result<()> {
    if !all_identical {
        bail!("the picture depends on the budget");
    }
    if !failed.is_empty() {
        bail!("{} of {} rows did not render", failed.len(), failed.len() + rendered);
    }
    Ok(())
}

/// The setting of a budget, KiB, for `percent` of `bytes`; 0 = no further limit.
pub(crate) fn budget_kib(percent: f64, bytes: u64) -> u32 {
    if percent >= 100.0 {
        return 0;
    }
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a budget; float casts saturate"
    )]
    let kib = (percent / 100.0 * bytes as f64 / 1024.0) as u32;
    kib.max(1)
}

/// Budgets with the policies of each; in core there is nothing to choose.
fn budget_rows(budgets: &[f64], policies: &[String]) -> Vec<(f64, String)> {
    let row = |&percent: &f64| match percent >= 100.0 {
        true => vec![(percent, String::new())],
        false => policies.iter().map(|policy| (percent, policy.clone())).collect(),
    };
    budgets.iter().flat_map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn budgets_are_parts_of_the_scene() {
        assert_eq!(budget_kib(100.0, 1 << 30), 0, "all of it: no limit");
        assert_eq!(budget_kib(25.0, 1 << 30), 1 << 18, "a quarter of a GiB, in KiB");
        assert_eq!(budget_kib(0.001, 1000), 1, "never the 0 that means no limit");
    }

    #[test]
    fn a_failed_row_does_not_stop_the_other_rows() {
        let policies = ["sweep".to_owned(), "benefit".to_owned()];
        let measure = |percent: f64, policy: &str, first: Option<&String>| {
            ensure!(policy != "sweep", "too small");
            Ok(format!("{percent} {policy} {}", first.is_some()))
        };
        let (rows, failed) = each(&[100.0, 10.0], &policies, measure, |_| {});
        assert_eq!(
            rows,
            ["100  false", "10 benefit true"],
            "in core there is no policy; the others are told the first row"
        );
        assert!(failed.len() == 1 && failed[0].policy == "sweep" && failed[0].message == "too small", "{failed:?}");
        assert!(verdict(true, 2, &failed).is_err() && verdict(false, 2, &[]).is_err(), "both are errors");
        assert!(verdict(true, 2, &[]).is_ok(), "all is well");
    }
}
