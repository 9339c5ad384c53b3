// SPDX-License-Identifier: Apache-2.0
//! Collects what the Vulkan validation layer says.
//!
//! The layer calls back on whatever thread made the faulty call; messages are kept in a [`ValidationLog`] that outlives
//! the [`Gpu`](crate::Gpu), so that leaks reported when the device is destroyed can be read too. Known false alarms are
//! dropped by `SUPPRESSED`, each with its reason.

use std::ffi::{CStr, c_void};
use std::sync::{Arc, Mutex, PoisonError};

use ash::vk;

/// A message id that is not a fault of ours, and why: the layer version, the driver, and when the line may go.
type SuppressedMessage = (&'static str, &'static str);

/// None is known for layer 1.3.239 with the drivers tried so far.
const SUPPRESSED: &[SuppressedMessage] = &[];

/// Warnings and errors of the validation layer. Clones share one list. Any thread.
#[derive(Clone, Debug, Default)]
pub struct ValidationLog {
    messages: Arc<Mutex<Vec<String>>>,
}

impl ValidationLog {
    /// Takes all messages so far, oldest first, each as `severity: [message id] text`.
    #[must_use]
    pub fn take(&self) -> Vec<String> {
        std::mem::take(&mut *self.messages.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn push(&self, message: String) {
        self.messages.lock().unwrap_or_else(PoisonError::into_inner).push(message);
    }

    /// Keeps or drops one message, by the rules of this module.
    fn receive(&self, suppressed: &[SuppressedMessage], severity: &str, (id, text): (&str, &str)) {
        if let Some((_, reason)) = suppressed.iter().find(|(known, _)| *known == id) {
            tracing::trace!(id, reason, "validation message suppressed");
            return;
        }
        tracing::warn!(id, "validation {severity}: {text}");
        self.push(format!("{severity}: [{id}] {text}"));
    }

    /// What to give the messenger as user data: valid as long as a clone of this log lives.
    fn as_user_data(&self) -> *mut c_void {
        Arc::as_ptr(&self.messages).cast_mut().cast()
    }

    /// Messenger description that reports into this log. The caller keeps a clone alive as long as the messenger and
    /// the instance made with it.
    pub(crate) fn messenger_info(&self) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
        vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(
                vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
            )
            .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
            .pfn_user_callback(Some(on_message))
            .user_data(self.as_user_data())
    }
}

/// Text of a C string that may be null.
///
/// # Safety
/// `text` is null or a NUL-terminated string that outlives the call.
unsafe fn text_of(text: *const std::ffi::c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: not null, and the caller promises a terminated string.
    let text = unsafe { CStr::from_ptr(text) };
    text.to_string_lossy().into_owned()
}

/// Called by the layer. Never unwinds: the only lock tolerates poisoning.
unsafe extern "system" fn on_message(
    severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user_data: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes null or a pointer that is valid during the call
    // (VUID-PFN_vkDebugUtilsMessengerCallbackEXT).
    let Some(data) = (unsafe { data.as_ref() }) else {
        return vk::FALSE;
    };
    let messages = user_data.cast_const().cast::<Mutex<Vec<String>>>();
    // SAFETY: `user_data` came from `Arc::as_ptr` of a log that the instance keeps alive, so a strong count is there to
    // add to.
    unsafe { Arc::increment_strong_count(messages) };
    // SAFETY: the count added above is the one this Arc gives back when it is dropped.
    let messages = unsafe { Arc::from_raw(messages) };
    let log = ValidationLog { messages };
    // SAFETY: strings of the callback data are null or terminated, and live during the call.
    let id = unsafe { text_of(data.p_message_id_name) };
    // SAFETY: as above.
    let text = unsafe { text_of(data.p_message) };
    let severity = if severity.contains(vk::DebugUtilsMessageSeverityFlagsEXT::ERROR) { "error" } else { "warning" };
    log.receive(SUPPRESSED, severity, (&id, &text));
    vk::FALSE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn suppressed_ids_are_dropped_and_others_kept() {
        let (log, list) = (ValidationLog::default(), [("VUID-noise", "planted for this test")]);
        log.receive(&list, "error", ("VUID-noise", "noise"));
        log.receive(&list, "error", ("VUID-real", "signal"));
        assert_eq!(log.take(), ["error: [VUID-real] signal"], "only the id outside the list is kept");
        assert_eq!(log.take(), Vec::<String>::new(), "take empties the log");
    }
}
