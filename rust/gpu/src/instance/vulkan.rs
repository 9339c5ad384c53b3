// SPDX-License-Identifier: Apache-2.0
//! The Vulkan loader, one instance and its debug messenger.
//!
//! Guarantees that messenger and log outlive everything made from the instance.
//!
//! One plain instance is shared by everything and kept until the process ends, because it keeps the drivers' libraries
//! loaded: NVIDIA's (580.159) can be loaded and unloaded only some tens of times in one process, after which no device
//! is found, and a Hydra host makes and drops render delegates at will. With validation, every [`Gpu`](crate::Gpu) has
//! an instance of its own besides, so that its messages are its own.

use std::ffi::CStr;
use std::sync::{Arc, Mutex, PoisonError};

use ash::vk;

use crate::error::GpuError;
use crate::instance::validation::ValidationLog;

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// What to check while calls are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ValidationLevel {
    Off,
    /// The Khronos layer, if installed.
    On,
    /// As `On`, and hazards between operations too (slow).
    OnWithSync,
}

/// The instance without validation, made on first use and kept.
static PLAIN: Mutex<Option<Arc<Instance>>> = Mutex::new(None);

/// A live instance. Dropped after the device: `LogicalDevice` holds it as its last field.
pub(crate) struct Instance {
    pub(crate) entry: ash::Entry,
    pub(crate) raw: ash::Instance,
    messenger: Option<(ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    pub(crate) log: ValidationLog,
    /// `VK_EXT_debug_utils` is enabled: objects can be named.
    pub(crate) names: bool,
    /// The validation layer is loaded.
    pub(crate) validating: bool,
}

/// Layers and extensions to ask for, as found on this machine.
struct InstanceRequest {
    layers: Vec<&'static CStr>,
    extensions: Vec<&'static CStr>,
    sync_validation: bool,
}

impl Instance {
    /// An instance with this much validation; the shared one without.
    ///
    /// # Errors [`GpuError::NoDevice`] when there is no loader, it is older than Vulkan 1.2, or no driver is installed.
    /// Tried anew by the next call.
    pub(crate) fn get(validation: ValidationLevel) -> Result<Arc<Self>, GpuError> {
        let mut plain = PLAIN.lock().unwrap_or_else(PoisonError::into_inner);
        let shared = match &*plain {
            Some(shared) => Arc::clone(shared),
            None => Arc::clone(plain.insert(Arc::new(Self::new(ValidationLevel::Off)?))),
        };
        match validation {
            ValidationLevel::Off => Ok(shared),
            // Under the lock too: instances are made one after the other.
            ValidationLevel::On | ValidationLevel::OnWithSync => Ok(Arc::new(Self::new(validation)?)),
        }
    }

    /// Loads libvulkan and makes an instance.
    fn new(validation: ValidationLevel) -> Result<Self, GpuError> {
        // SAFETY: loads the system's Vulkan loader and runs its constructors; nothing else in this process relies on it
        // not being loaded, and `entry` keeps it loaded as long as any function pointer from it is used.
        let entry = unsafe { ash::Entry::load() }.map_err(|error| GpuError::NoDevice {
            reason: format!(
                "the Vulkan loader did not load ({error}); install it and a driver (on Debian: libvulkan1 \
                mesa-vulkan-drivers)"
            ),
        })?;
        // SAFETY: no preconditions beyond a loaded entry.
        let version = unsafe { entry.try_enumerate_instance_version() }
            .map_err(|code| vulkan_error("vkEnumerateInstanceVersion", code))?
            .unwrap_or(vk::API_VERSION_1_0);
        if version < vk::API_VERSION_1_2 {
            return Err(GpuError::NoDevice {
                reason: "the Vulkan loader is older than 1.2; update libvulkan1".to_owned(),
            });
        }
        let wanted = InstanceRequest::probe(&entry, validation)?;
        let log = ValidationLog::default();
        let raw = wanted.create(&entry, &log)?;
        let names = wanted.extensions.contains(&ash::ext::debug_utils::NAME);
        let validating = !wanted.layers.is_empty();
        let mut instance = Self { entry, raw, messenger: None, log, names, validating };
        if names && validating {
            instance.attach_messenger()?;
        }
        Ok(instance)
    }

    fn attach_messenger(&mut self) -> Result<(), GpuError> {
        let utils = ash::ext::debug_utils::Instance::new(&self.entry, &self.raw);
        let info = self.log.messenger_info();
        // SAFETY: the extension is enabled, and `self.log` outlives the messenger (destroyed in Drop before the log).
        let messenger = unsafe { utils.create_debug_utils_messenger(&info, None) }
            .map_err(|code| vulkan_error("vkCreateDebugUtilsMessengerEXT", code))?;
        self.messenger = Some((utils, messenger));
        Ok(())
    }
}

impl InstanceRequest {
    fn probe(entry: &ash::Entry, validation: ValidationLevel) -> Result<Self, GpuError> {
        // SAFETY: no preconditions beyond a loaded entry.
        let layers = unsafe { entry.enumerate_instance_layer_properties() }
            .map_err(|code| vulkan_error("vkEnumerateInstanceLayerProperties", code))?;
        let has_layer = layers.iter().any(|layer| layer.layer_name_as_c_str() == Ok(VALIDATION_LAYER));
        let mut wanted = Self { layers: Vec::new(), extensions: Vec::new(), sync_validation: false };
        if validation != ValidationLevel::Off {
            if has_layer {
                wanted.layers.push(VALIDATION_LAYER);
            } else {
                tracing::warn!("validation was asked for, but VK_LAYER_KHRONOS_validation is not installed");
            }
        }
        let validating = !wanted.layers.is_empty();
        if extension_names(entry, None)?.iter().any(|name| name.as_c_str() == ash::ext::debug_utils::NAME)
            || (validating && has_extension(entry, VALIDATION_LAYER, ash::ext::debug_utils::NAME)?)
        {
            wanted.extensions.push(ash::ext::debug_utils::NAME);
        }
        if validating
            && validation == ValidationLevel::OnWithSync
            && has_extension(entry, VALIDATION_LAYER, ash::ext::validation_features::NAME)?
        {
            wanted.extensions.push(ash::ext::validation_features::NAME);
            wanted.sync_validation = true;
        }
        Ok(wanted)
    }

    fn create(&self, entry: &ash::Entry, log: &ValidationLog) -> Result<ash::Instance, GpuError> {
        let application = vk::ApplicationInfo::default()
            .application_name(c"OocPT")
            .engine_name(c"OocPT")
            .api_version(vk::API_VERSION_1_2);
        let layers: Vec<_> = self.layers.iter().map(|name| name.as_ptr()).collect();
        let extensions: Vec<_> = self.extensions.iter().map(|name| name.as_ptr()).collect();
        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&application)
            .enabled_layer_names(&layers)
            .enabled_extension_names(&extensions);
        // Reports what happens inside vkCreateInstance and vkDestroyInstance, where the messenger itself does not
        // exist.
        let mut messenger = log.messenger_info();
        if !layers.is_empty() && self.extensions.contains(&ash::ext::debug_utils::NAME) {
            info = info.push_next(&mut messenger);
        }
        let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
        if self.sync_validation {
            info = info.push_next(&mut features);
        }
        // SAFETY: all names were found by the probe, and every pointer in `info` lives until the call returns; the log
        // outlives the instance because `Instance` owns both and drops the instance first.
        unsafe { entry.create_instance(&info, None) }.map_err(|code| match code {
            vk::Result::ERROR_INCOMPATIBLE_DRIVER => GpuError::NoDevice {
                reason: "no Vulkan driver is installed (on Debian: mesa-vulkan-drivers)".to_owned(),
            },
            other => vulkan_error("vkCreateInstance", other),
        })
    }
}

/// Names of the instance extensions of a layer, or of the loader and drivers.
fn extension_names(entry: &ash::Entry, layer: Option<&CStr>) -> Result<Vec<std::ffi::CString>, GpuError> {
    // SAFETY: `layer`, if any, was found by vkEnumerateInstanceLayerProperties.
    let properties = unsafe { entry.enumerate_instance_extension_properties(layer) }
        .map_err(|code| vulkan_error("vkEnumerateInstanceExtensionProperties", code))?;
    Ok(properties.iter().filter_map(|p| p.extension_name_as_c_str().ok().map(CStr::to_owned)).collect())
}

fn has_extension(entry: &ash::Entry, layer: &CStr, extension: &CStr) -> Result<bool, GpuError> {
    Ok(extension_names(entry, Some(layer))?.iter().any(|name| name.as_c_str() == extension))
}

/// The error for a call that failed outside a device.
pub(crate) fn vulkan_error(call: &'static str, code: vk::Result) -> GpuError {
    GpuError::Vulkan { call, code: format!("{code:?}") }
}

impl Drop for Instance {
    fn drop(&mut self) {
        if let Some((utils, messenger)) = self.messenger.take() {
            // SAFETY: made from this instance, destroyed once.
            unsafe { utils.destroy_debug_utils_messenger(messenger, None) };
        }
        // SAFETY: `LogicalDevice` drops its children and itself before its `Instance` field; the log is still alive for
        // messages.
        unsafe { self.raw.destroy_instance(None) };
    }
}

impl std::fmt::Debug for Instance {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Instance").field("validating", &self.validating).finish_non_exhaustive()
    }
}
