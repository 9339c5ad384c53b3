// SPDX-License-Identifier: Apache-2.0
//! The boundary's part for command lines, warnings and limits, which needs no session. Guarantees and threads as in
//! `lib.rs`.

use crate::guard::{BridgeError, guard};
use crate::runner::{self, begin_picture, interrupt, picture_rendered};
use crate::settings;
use ffi::{Interrupted, PrimWarning};
use oocpt_core::scene::{SceneWarning, summary};
use oocpt_core::settings::{SettingScope, Settings};

/// See [`runner::interrupted`].
fn interrupted() -> Result<Interrupted, BridgeError> {
    let (is_interrupted, early) = runner::interrupted()?;
    Ok(Interrupted { is_interrupted, samples: early.samples, target: early.target })
}

/// What to post for the warnings of a reader of prims: few lines where many prims say the like.
fn summed_warnings(warnings: Vec<PrimWarning>) -> Result<Vec<String>, BridgeError> {
    guard("summed_warnings", || {
        let warning = |w: PrimWarning| SceneWarning::of_notes(w.path.into(), vec![w.text]);
        Ok(summary(&warnings.into_iter().map(warning).collect::<Vec<_>>()))
    })
}

/// Whether a scene may set the setting of that name; also where there is none.
fn scene_may_set(key: &str) -> bool {
    Settings::scope(key) != Some(SettingScope::Machine)
}

/// See [`settings::set_on_command_line`].
fn set_on_command_line(name: &str, text: &str) -> Result<(), BridgeError> {
    guard("set_on_command_line", || Ok(settings::set_on_command_line(name, text)?))
}

/// Clipping planes of a camera that count.
fn max_clip_planes() -> usize {
    oocpt_core::MAX_CLIP_PLANES
}

/// Declarations that cxx turns into both sides of the boundary.
#[allow(
    unsafe_code,
    missing_docs,
    missing_debug_implementations,
    unreachable_pub,
    unused_qualifications,
    clippy::multiple_unsafe_ops_per_block,
    clippy::undocumented_unsafe_blocks,
    clippy::use_self,
    reason = "cxx expands this module into extern blocks and shims"
)]
#[cxx::bridge(namespace = "oocpt")]
mod ffi {
    /// What a reader complains about.
    #[derive(Debug, Clone)]
    struct PrimWarning {
        path: String,
        text: String,
    }

    /// How far the picture of an interrupted command line is; `samples` is 0 where nothing of it is to be written.
    #[derive(Debug, Clone, Copy)]
    struct Interrupted {
        is_interrupted: bool,
        samples: u32,
        target: u32,
    }

    extern "Rust" {
        fn summed_warnings(warnings: Vec<PrimWarning>) -> Result<Vec<String>>;
        fn scene_may_set(key: &str) -> bool;
        fn max_clip_planes() -> usize;
        fn set_on_command_line(name: &str, text: &str) -> Result<()>;

        fn begin_picture(folder: &str) -> Result<bool>;
        fn picture_rendered() -> Result<()>;
        fn interrupt() -> Result<bool>;
        fn interrupted() -> Result<Interrupted>;
    }
}
