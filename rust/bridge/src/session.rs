// SPDX-License-Identifier: Apache-2.0
//! The object that C++ holds: a render session, its settings layers, and messages that arose at the boundary itself.
//!
//! Every method may be called from any thread; none panics out (see [`crate::guard`]).

use crate::convert;
use crate::edits;
use crate::ffi::{
    MessageSeverity, NamedValue, NamingPrimvarDesc, ProductDesc, RenderDesc, ScalarValue, SceneEdits,
    SettingDescriptor, SettingOutcome, UserMessage,
};
use crate::ffi_images::ImageSource;
use crate::guard::{BridgeError, guard};
use crate::images::HostImages;
use crate::settings::{self, SettingLayers};
use crate::{logging, runner, stats};
use cxx::UniquePtr;
use oocpt_core::desc::prim_mask_names;
use oocpt_render::textures::ImageLibrary;
use oocpt_render::{AovKind, SceneEdit, SessionOptions, Severity};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// One renderer.
pub(crate) struct Session {
    inner: Arc<oocpt_render::Session>,
    layers: Mutex<SettingLayers>,
    /// The purposes of the last request.
    purposes: Mutex<Option<Vec<String>>>,
    naming: Mutex<convert::product::NamingPrimvars>,
    /// Warnings of the boundary itself, handed out before the renderer's.
    warnings: Arc<Mutex<Vec<String>>>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn environment(name: &str) -> Option<String> {
    std::env::var(name).ok()
}

/// Options from the environment: `OOCPT_VALIDATION` (the Vulkan validation layer's messages become errors; for tests),
/// `OOCPT_PROFILE` (seconds on the device by pass, in the stats) and `OOCPT_PROGRESS` (a progress bar on standard
/// error; set by the command line runner).
fn options(variable: impl Fn(&str) -> Option<String>) -> SessionOptions {
    let is_on = |text: String| matches!(text.trim(), "1" | "true" | "on" | "yes");
    SessionOptions {
        validation: variable("OOCPT_VALIDATION").is_some_and(is_on),
        profile: variable("OOCPT_PROFILE").is_some_and(is_on),
        progress_bar: variable("OOCPT_PROGRESS").is_some_and(is_on),
        closing_words: true,
        ..SessionOptions::default()
    }
}

/// A new session with an empty scene; reads the `OOCPT_*` variables and sets up the log.
pub(crate) fn open_session(images: UniquePtr<ImageSource>) -> Result<Box<Session>, BridgeError> {
    guard("open_session", || {
        logging::install();
        let (layers, warnings) = SettingLayers::new(environment);
        let files = Arc::new(HostImages::new(images));
        let inner = oocpt_render::Session::with_options(layers.settings(), options(environment))
            .with_images(Arc::clone(&files) as Arc<dyn ImageLibrary>);
        inner.set_light_files(files);
        let inner = Arc::new(inner);
        runner::session_opened(&inner);
        let (layers, warnings) = (Mutex::new(layers), Arc::new(Mutex::new(warnings)));
        Ok(Box::new(Session { inner, layers, purposes: Mutex::default(), warnings, naming: Mutex::default() }))
    })
}

/// Ends a session: waits for its threads, the commit under way included, and frees everything.
#[allow(clippy::boxed_local, reason = "C++ hands over the box that it holds")]
pub(crate) fn close_session(session: Box<Session>) -> Result<(), BridgeError> {
    guard("close_session", move || {
        drop(session);
        Ok(())
    })
}

/// The primvars, without `primvars:`, whose texts name what products show; sorted.
#[allow(clippy::ptr_arg, reason = "C++ hands over its vector")]
pub(crate) fn naming_primvars(products: &Vec<ProductDesc>) -> Result<Vec<String>, BridgeError> {
    guard("naming_primvars", || Ok(convert::product::names_of_naming(products)))
}

/// The primvars that say which rays see a prim, without `primvars:`.
pub(crate) fn ray_primvar_names() -> Result<Vec<String>, BridgeError> {
    guard("ray_primvar_names", || Ok(prim_mask_names().map(str::to_owned).collect()))
}

/// The settings that hosts list, without a session: the environment's values are the defaults.
pub(crate) fn setting_descriptors() -> Result<Vec<SettingDescriptor>, BridgeError> {
    guard("setting_descriptors", || Ok(SettingLayers::new(environment).0.descriptors()))
}

impl Session {
    /// Edits the scene; takes effect with the next render. The commit thread converts what is given.
    pub(crate) fn apply_edits(&self, edits: SceneEdits) -> Result<(), BridgeError> {
        guard("apply_edits", || {
            self.inner.edit(edits::of(edits, &self.warnings));
            Ok(())
        })
    }

    /// Starts again with an empty scene.
    pub(crate) fn clear_scene(&self) -> Result<(), BridgeError> {
        guard("clear_scene", || {
            self.inner.edit(vec![SceneEdit::Remove("/".to_owned())]);
            Ok(())
        })
    }

    /// Sets an explicit value of the host.
    pub(crate) fn set_setting(&self, key: &str, value: &ScalarValue) -> Result<SettingOutcome, BridgeError> {
        guard("set_setting", || {
            if !settings::is_known(key) {
                return Ok(SettingOutcome::Unknown);
            }
            let Some(value) = settings::value(value) else {
                return Ok(SettingOutcome::Unknown);
            };
            let mut layers = lock(&self.layers);
            let counts = layers.left_of(layers.settings(), key, value.clone())?;
            let changed = self.inner.set_setting(key, counts)?;
            tracing::debug!(key, ?value, changed, "setting");
            layers.set(key, value);
            Ok(outcome(changed))
        })
    }

    /// Removes an explicit value: the environment's or the default counts again.
    pub(crate) fn clear_setting(&self, key: &str) -> Result<SettingOutcome, BridgeError> {
        guard("clear_setting", || {
            if !settings::is_known(key) {
                return Ok(SettingOutcome::Unknown);
            }
            let mut layers = lock(&self.layers);
            if !layers.clear(key) {
                return Ok(SettingOutcome::Unchanged);
            }
            let mut changed = false;
            for (key, value) in layers.resolved() {
                changed |= self.inner.set_setting(&key, value)?;
            }
            Ok(outcome(changed))
        })
    }

    /// Has the scene committed and rendered in the background, and products written.
    pub(crate) fn render(&self, request: RenderDesc, products: Vec<ProductDesc>) -> Result<(), BridgeError> {
        guard("render", || {
            let mut purposes = lock(&self.purposes);
            if purposes.as_ref() != Some(&request.purposes) {
                *purposes = Some(request.purposes.clone());
                self.inner.edit(vec![edits::purposes(request.purposes.clone())]);
            }
            drop(purposes);
            let request = convert::request::render_request(&request);
            tracing::trace!(?request, "render");
            let naming = lock(&self.naming);
            let products = products.into_iter().map(|product| convert::product::render_product(product, &naming));
            let products = products.collect();
            drop(naming);
            self.inner.render_products(request, products);
            Ok(())
        })
    }

    /// Takes the primvars that name what the products of the next requests show.
    pub(crate) fn set_naming_primvars(&self, primvars: Vec<NamingPrimvarDesc>) -> Result<(), BridgeError> {
        guard("set_naming_primvars", || {
            *lock(&self.naming) = convert::product::naming_primvars(primvars);
            Ok(())
        })
    }

    /// Returns true if products that are handed over with a request are written.
    pub(crate) fn writes_products(&self) -> Result<bool, BridgeError> {
        guard("writes_products", || Ok(self.inner.writes_products()))
    }

    /// Returns true if the images are final.
    pub(crate) fn is_converged(&self) -> Result<bool, BridgeError> {
        guard("is_converged", || Ok(self.inner.is_converged()))
    }

    /// Pauses: no new wave starts.
    pub(crate) fn pause(&self) -> Result<(), BridgeError> {
        guard("pause", || {
            self.inner.pause();
            Ok(())
        })
    }

    /// Ends a pause.
    pub(crate) fn resume(&self) -> Result<(), BridgeError> {
        guard("resume", || {
            self.inner.resume();
            Ok(())
        })
    }

    /// Returns true if the session is paused.
    pub(crate) fn is_paused(&self) -> Result<bool, BridgeError> {
        guard("is_paused", || Ok(self.inner.is_paused()))
    }

    /// Stops rendering; the images stay as they are.
    pub(crate) fn stop(&self, blocking: bool) -> Result<(), BridgeError> {
        guard("stop", || {
            self.inner.stop(blocking);
            Ok(())
        })
    }

    /// Returns true if the session was stopped.
    pub(crate) fn is_stopped(&self) -> Result<bool, BridgeError> {
        guard("is_stopped", || Ok(self.inner.is_stopped()))
    }

    /// Renders the last request again from its first sample.
    pub(crate) fn restart(&self) -> Result<(), BridgeError> {
        guard("restart", || {
            self.inner.restart();
            Ok(())
        })
    }

    /// Copies the newest image named by Hydra's token unless it is the `known` version; returns its version, 0 if there
    /// is no image of that size.
    pub(crate) fn read_aov(&self, name: &str, known: u64, destination: &mut [u8]) -> Result<u64, BridgeError> {
        guard("read_aov", || {
            Ok(AovKind::from_token(name).map_or(0, |kind| self.inner.read_new_aov(kind, known, destination)))
        })
    }

    /// Counters under the keys that hosts read.
    pub(crate) fn stats(&self) -> Result<Vec<NamedValue>, BridgeError> {
        guard("stats", || {
            // First: once no commit is pending, the newest job is that of the newest request.
            let commits = stats::commits(&self.inner.commit_progress());
            let jobs = stats::jobs([self.inner.generation(), self.inner.shown_generation()]);
            Ok(stats::named_values(&self.inner.stats()).into_iter().chain(jobs).chain(commits).collect())
        })
    }

    /// The messages for the user since the last call.
    pub(crate) fn take_messages(&self) -> Result<Vec<UserMessage>, BridgeError> {
        guard("take_messages", || {
            let warnings = std::mem::take(&mut *lock(&self.warnings));
            let own = warnings.into_iter().map(|text| UserMessage { severity: MessageSeverity::Warning, text });
            let renderers = self.inner.take_messages().into_iter().map(|message| {
                let severity = match message.severity {
                    Severity::Status => MessageSeverity::Status,
                    Severity::Warning => MessageSeverity::Warning,
                    Severity::Error => MessageSeverity::Error,
                };
                UserMessage { severity, text: message.text }
            });
            Ok(own.chain(renderers).collect())
        })
    }
}

fn outcome(changed: bool) -> SettingOutcome {
    if changed { SettingOutcome::Changed } else { SettingOutcome::Unchanged }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn validation_and_profiling_are_off_unless_asked_for() {
        let with = |key: &'static str, text: &'static str| options(move |name| (name == key).then(|| text.to_owned()));
        let unset = options(|_| None);
        assert!(!unset.validation && !unset.profile, "unset");
        let of = |text| {
            let (validation, profile) = (with("OOCPT_VALIDATION", text), with("OOCPT_PROFILE", text));
            assert!(!validation.profile && !profile.validation, "each has its own variable");
            [validation.validation, profile.profile]
        };
        assert_eq!(of("0"), [false; 2], "zero");
        assert_eq!(of("1"), [true; 2], "one");
    }
}
