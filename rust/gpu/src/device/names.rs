// SPDX-License-Identifier: Apache-2.0
//! Names and labels for debuggers and validation messages, through `VK_EXT_debug_utils` when it is there.
//!
//! A failure to name is not a failure: nothing here returns an error. Any thread.

use std::ffi::CString;

use ash::vk;

/// Gives names to objects and labels to stretches of command buffers; does nothing without the extension.
#[derive(Clone, Default)]
pub(crate) struct DebugNames {
    utils: Option<ash::ext::debug_utils::Device>,
}

impl DebugNames {
    pub(crate) fn new(instance: &ash::Instance, device: &ash::Device, enabled: bool) -> Self {
        Self { utils: enabled.then(|| ash::ext::debug_utils::Device::new(instance, device)) }
    }

    /// Names an object that the caller alone is using now.
    pub(crate) fn set<T: vk::Handle>(&self, object: T, name: &str) {
        let Some(utils) = &self.utils else { return };
        let name = c_string(name);
        let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(object).object_name(&name);
        // SAFETY: the object is alive and not in use by another thread (every caller has just created it).
        if let Err(code) = unsafe { utils.set_debug_utils_object_name(&info) } {
            tracing::debug!("vkSetDebugUtilsObjectNameEXT failed: {code:?}");
        }
    }

    /// Opens a label; each is closed by [`DebugNames::end`] in the same command buffer.
    pub(crate) fn begin(&self, commands: vk::CommandBuffer, name: &str) {
        let Some(utils) = &self.utils else { return };
        let name = c_string(name);
        let info = vk::DebugUtilsLabelEXT::default().label_name(&name);
        // SAFETY: `commands` is recording and owned by the caller.
        unsafe { utils.cmd_begin_debug_utils_label(commands, &info) };
    }

    pub(crate) fn end(&self, commands: vk::CommandBuffer) {
        let Some(utils) = &self.utils else { return };
        // SAFETY: `commands` is recording, and a label was opened in it by `begin`.
        unsafe { utils.cmd_end_debug_utils_label(commands) };
    }
}

/// The name up to its first NUL.
fn c_string(name: &str) -> CString {
    let end = name.find('\0').unwrap_or(name.len());
    CString::new(&name[..end]).unwrap_or_default()
}

impl std::fmt::Debug for DebugNames {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Names").field("enabled", &self.utils.is_some()).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::c_string;

    #[test]
    fn names_end_at_the_first_nul() {
        assert_eq!(c_string("a\0b").as_bytes(), b"a", "cut, not lost");
        assert_eq!(c_string("plain").as_bytes(), b"plain", "unchanged");
    }
}
