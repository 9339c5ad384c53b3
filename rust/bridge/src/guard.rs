// SPDX-License-Identifier: Apache-2.0
//! Keeps panics on the Rust side: every function of the bridge runs inside [`guard`].
//!
//! Any thread. After a caught panic the session stays usable as far as its own invariants allow: its state lies behind
//! mutexes that ignore poisoning.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// The errors that C++ gets as the text of `rust::Error`.
#[derive(Debug, thiserror::Error)]
pub(crate) enum BridgeError {
    /// A defect of this program; the host goes on.
    #[error("internal error in {function}: {text}")]
    Panicked {
        /// The bridge function.
        function: &'static str,
        /// The panic message.
        text: String,
    },
    /// A setting was refused.
    #[error(transparent)]
    Setting(#[from] oocpt_core::settings::SettingError),
    /// The file of a picture was not changed.
    #[error(transparent)]
    Picture(#[from] oocpt_render::picture::PictureError),
}

/// Runs the body of a bridge function; a panic in it becomes an error.
pub(crate) fn guard<T>(
    function: &'static str,
    body: impl FnOnce() -> Result<T, BridgeError>,
) -> Result<T, BridgeError> {
    match catch_unwind(AssertUnwindSafe(body)) {
        Ok(result) => result,
        Err(payload) => {
            let text = panic_text(payload.as_ref());
            tracing::error!(function, text, "caught a panic at the bridge");
            Err(BridgeError::Panicked { function, text })
        }
    }
}

fn panic_text(payload: &(dyn Any + Send)) -> String {
    payload
        .downcast_ref::<&str>()
        .map(|text| (*text).to_owned())
        .or_else(|| payload.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "a panic without text".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_an_error_with_its_text() {
        let result: Result<(), _> = guard("render", || panic!("index {} of {}", 7, 3));
        let text = result.expect_err("the panic must not pass").to_string();
        assert_eq!(text, "internal error in render: index 7 of 3", "function and text must be named");
    }

    #[test]
    fn a_static_panic_text_is_kept() {
        let result: Result<(), _> = guard("stop", || panic!("plain"));
        assert!(result.expect_err("the panic must not pass").to_string().ends_with("plain"), "the text must be kept");
    }

    #[test]
    fn values_pass_through() {
        assert_eq!(guard("stats", || Ok(3)).expect("no panic, no error"), 3, "the value must be handed on");
    }
}
