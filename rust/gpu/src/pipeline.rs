// SPDX-License-Identifier: Apache-2.0
//! Compute pipelines from SPIR-V.
//!
//! Trust: shaders reach memory by address, so a wrong shader or a wrong address in a push constant can fault the device
//! (reported as [`GpuError::DeviceLost`]; on a software renderer it can fault the process). Give this only SPIR-V that
//! was validated when it was built. Any thread; several pipelines may be made at once and share one cache, which may be
//! kept on disk ([`OpenOptions::pipeline_cache`](crate::OpenOptions::pipeline_cache)).

use std::sync::Arc;

use ash::vk;

use crate::device::compute_pipeline::ComputePipeline;
use crate::error::GpuError;
use crate::gpu::Gpu;

/// A compute pipeline with its push constants.
#[derive(Debug)]
pub struct Pipeline {
    pub(crate) inner: Arc<ComputePipeline>,
}

const SPIRV_MAGIC: u32 = 0x0723_0203;
const SPIRV_HEADER_WORDS: usize = 5;
const OP_ENTRY_POINT: u32 = 15;
const EXECUTION_MODEL_GL_COMPUTE: u32 = 5;

impl Pipeline {
    /// Compiles `words` for its compute entry point `main`, with 32-bit specialisation constants `(id, value)` and
    /// `push_bytes` of push constants. May take seconds on a software renderer.
    ///
    /// # Errors
    /// [`GpuError::Usage`] for words that are no compute shader or a push size that is no multiple of 4 or above the
    /// limit; [`GpuError::Vulkan`] when the driver refuses; [`GpuError::DeviceLost`].
    pub fn new(
        gpu: &Arc<Gpu>,
        name: &str,
        words: &[u32],
        spec: &[(u32, u32)],
        push_bytes: u32,
    ) -> Result<Self, GpuError> {
        let device = gpu.device();
        device.check_alive()?;
        let misuse = |message: String| GpuError::Usage { name: name.to_owned(), message };
        if !has_compute_main(words) {
            return Err(misuse("no SPIR-V with a compute entry point \"main\"".to_owned()));
        }
        if !push_bytes.is_multiple_of(4) || push_bytes > device.limits.max_push_bytes {
            let limit = device.limits.max_push_bytes;
            return Err(misuse(format!(
                "{push_bytes} bytes of push constants; multiples of 4 up to {limit} are allowed"
            )));
        }
        let info = vk::ShaderModuleCreateInfo::default().code(words);
        // SAFETY: the words are SPIR-V with the magic number and an entry point; the caller vouches for their validity
        // (see module).
        let module = device.check("vkCreateShaderModule", unsafe { device.raw.create_shader_module(&info, None) })?;
        let made = ComputePipeline::new((device, gpu.pipeline_cache()), name, module, spec, push_bytes);
        // SAFETY: the module is needed only while the pipeline is made.
        unsafe { device.raw.destroy_shader_module(module, None) };
        Ok(Self { inner: Arc::new(made?) })
    }

    /// Name that it was created with, which its dispatches have in timings, labels and crash reports.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.inner.name
    }

    /// Size of its push constants in bytes.
    #[must_use]
    pub fn push_bytes(&self) -> u32 {
        self.inner.push_bytes
    }
}

/// Returns true if the words start as SPIR-V and declare a compute entry point called `main`. Bounds are checked: words
/// may be anything.
fn has_compute_main(words: &[u32]) -> bool {
    if words.first() != Some(&SPIRV_MAGIC) {
        return false;
    }
    let mut rest = words.get(SPIRV_HEADER_WORDS..).unwrap_or_default();
    while let Some(&first) = rest.first() {
        let (length, code) = ((first >> 16) as usize, first & 0xFFFF);
        let Some(instruction) = rest.get(..length).filter(|_| length > 0) else {
            return false;
        };
        if code == OP_ENTRY_POINT
            && instruction.get(1) == Some(&EXECUTION_MODEL_GL_COMPUTE)
            && instruction.get(3) == Some(&u32::from_le_bytes(*b"main"))
            && instruction.get(4) == Some(&0)
        {
            return true;
        }
        rest = &rest[length..];
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_spirv_with_a_compute_main_is_taken() {
        let header = [SPIRV_MAGIC, 0x1_0500, 0, 8, 0];
        let entry = [(5 << 16) | OP_ENTRY_POINT, EXECUTION_MODEL_GL_COMPUTE, 4, u32::from_le_bytes(*b"main"), 0];
        let good = [&header[..], &entry[..]].concat();
        assert!(has_compute_main(&good), "the smallest module with main");
        assert!(!has_compute_main(&[]), "empty");
        assert!(!has_compute_main(&good[..7]), "cut inside an instruction");
        assert!(!has_compute_main(&[&header[..], &[0]].concat()), "an instruction of no length must not loop");
        let mut other = good.clone();
        other[6] = 0;
        assert!(!has_compute_main(&other), "a vertex shader");
    }
}
