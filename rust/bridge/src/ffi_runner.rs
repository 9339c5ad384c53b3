// SPDX-License-Identifier: Apache-2.0
//! The boundary's part for command lines, warnings and limits, which needs no session. Guarantees and threads are those
//! of `lib.rs`.

use crate::guard::{BridgeError, guard};
use crate::runner::{self, annotate_picture, begin_picture, interrupt, make_checkpoint, picture_rendered};
use crate::settings;
use ffi::{InterruptState, PrimWarning};
use oocpt_core::scene::{SceneWarning, summary};
use oocpt_core::settings::{SettingScope, Settings};

/// The state of interruption: [`runner::interrupted`].
fn interrupted() -> Result<InterruptState, BridgeError> {
    let (is_interrupted, early) = runner::interrupted()?;
    Ok(InterruptState { is_interrupted, samples: early.samples, target: early.target })
}

/// The lines to post for the warnings of a reader of prims: few lines if many prims have the same text.
fn summed_warnings(warnings: Vec<PrimWarning>) -> Result<Vec<String>, BridgeError> {
    guard("summed_warnings", || {
        let warning = |w: PrimWarning| SceneWarning::of_notes(w.path.into(), vec![w.text]);
        Ok(summary(&warnings.into_iter().map(warning).collect::<Vec<_>>()))
    })
}

/// Returns true if a scene may set the setting of that name; also if there is no such setting.
fn scene_may_set(key: &str) -> bool {
    Settings::scope(key) != Some(SettingScope::Machine)
}

/// What is said of the name of a setting that there is not; empty if there is one.
fn unknown_setting(key: &str) -> String {
    Settings::key_named(key).err().map_or_else(String::new, |error| error.to_string())
}

/// Sets a setting: [`settings::set_on_command_line`].
fn set_on_command_line(name: &str, text: &str) -> Result<(), BridgeError> {
    guard("set_on_command_line", || Ok(settings::set_on_command_line(name, text)?))
}

/// What is wrong with the name of an AOV on a command line; empty if there is one of that name.
fn unknown_aov(name: &str) -> String {
    oocpt_render::unknown_aov(name).unwrap_or_default()
}

/// Most clipping planes of a camera that are used.
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
    /// A warning of a reader of prims.
    #[derive(Debug, Clone)]
    struct PrimWarning {
        path: String,
        text: String,
    }

    /// The progress of the picture of an interrupted command line; `samples` is 0 if nothing of it is to be written.
    #[derive(Debug, Clone, Copy)]
    struct InterruptState {
        is_interrupted: bool,
        samples: u32,
        target: u32,
    }

    extern "Rust" {
        fn summed_warnings(warnings: Vec<PrimWarning>) -> Result<Vec<String>>;
        fn scene_may_set(key: &str) -> bool;
        fn unknown_setting(key: &str) -> String;
        fn unknown_aov(name: &str) -> String;
        fn max_clip_planes() -> usize;
        fn set_on_command_line(name: &str, text: &str) -> Result<()>;

        fn begin_picture(folder: &str) -> Result<bool>;
        fn picture_rendered() -> Result<()>;
        fn annotate_picture(path: &str) -> Result<()>;
        fn interrupt() -> Result<bool>;
        fn make_checkpoint() -> Result<()>;
        fn interrupted() -> Result<InterruptState>;
    }
}
