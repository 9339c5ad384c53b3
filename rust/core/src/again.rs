// SPDX-License-Identifier: Apache-2.0
//! Retries operations that may have failed only for a moment, such as reads of a busy or distant disk. Pure: the caller
//! waits.

use std::time::Duration;

/// Calls `read` until it succeeds, at most once more after each of `pauses`, and only after errors that `may_pass`
/// accepts; `wait` waits for a pause.
///
/// # Errors
/// The error of the last call.
pub fn again<T, E>(
    pauses: &[Duration],
    may_pass: impl Fn(&E) -> bool,
    wait: impl Fn(Duration),
    mut read: impl FnMut() -> Result<T, E>,
) -> Result<T, E> {
    let mut result = read();
    for pause in pauses {
        match &result {
            Err(error) if may_pass(error) => {
                wait(*pause);
                result = read();
            }
            _ => break,
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Result of a read that fails `fails` times, and the number of times that it is tried.
    fn read(fails: usize, may_pass: bool) -> (Result<(), usize>, usize) {
        let mut reads = 0;
        let waited = std::cell::Cell::new(0);
        let result = again(
            &[Duration::ZERO; 3],
            |_| may_pass,
            |_| waited.set(waited.get() + 1),
            || {
                reads += 1;
                if reads > fails { Ok(()) } else { Err(reads) }
            },
        );
        assert_eq!(waited.get() + 1, reads, "a pause before each try but the first");
        (result, reads)
    }

    #[test]
    fn failed_reads_are_retried_three_times() {
        assert_eq!(read(0, true), (Ok(()), 1));
        assert_eq!(read(3, true), (Ok(()), 4));
        assert_eq!(read(9, true), (Err(4), 4), "the last error");
        assert_eq!(read(1, false), (Err(1), 1), "what will not pass is not tried again");
    }
}
