// SPDX-License-Identifier: Apache-2.0
//! Code that the tests share: an opened device that checks its validation log at the end, shaders compiled at run time,
//! plain casts.

use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use oocpt_gpu::{Buffer, Gpu, OpenOptions, Pipeline, Submission, ValidationLog};

/// `dst[i] = src[i] * SCALE + add`, one invocation per element.
pub(crate) const AFFINE: &str = r"
#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
layout(local_size_x = 64) in;
layout(constant_id = 0) const uint SCALE = 1;
layout(buffer_reference, scalar) buffer Words { uint at[]; };
layout(push_constant, scalar) uniform Push { uint64_t src; uint64_t dst; uint count; uint add; };
void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i < count) Words(dst).at[i] = Words(src).at[i] * SCALE + add;
}
";

/// Spins for `rounds`, then writes the result: work that takes a while.
pub(crate) const SPIN: &str = r"
#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
layout(local_size_x = 1) in;
layout(buffer_reference, scalar) buffer Words { uint at[]; };
layout(push_constant, scalar) uniform Push { uint64_t dst; uint rounds; uint pad; };
void main() {
    uint x = 1u;
    for (uint i = 0u; i < rounds; ++i) { x = x * 1664525u + 1013904223u + (x >> 7); }
    Words(dst).at[0] = x | 1u;
}
";

/// Rounds of [`SPIN`] that take some tens of milliseconds on a software renderer.
pub(crate) const LONG: u32 = 30_000_000;

/// An open device. Dropping it closes the device and fails the test if the validation layer said anything.
#[derive(Debug)]
pub(crate) struct TestGpu {
    gpu: Option<Arc<Gpu>>,
    log: ValidationLog,
}

/// Options of the tests: validation with hazards, on the device under test.
pub(crate) fn options() -> OpenOptions {
    OpenOptions {
        selector: std::env::var("OOCPT_TEST_DEVICE").ok(),
        validation: true,
        sync_validation: true,
        ..OpenOptions::default()
    }
}

pub(crate) fn open() -> TestGpu {
    open_with(&options())
}

pub(crate) fn open_with(options: &OpenOptions) -> TestGpu {
    let gpu = Gpu::open(options).expect("a device to test on");
    let log = gpu.validation_log();
    TestGpu { gpu: Some(gpu), log }
}

impl Deref for TestGpu {
    type Target = Arc<Gpu>;

    fn deref(&self) -> &Self::Target {
        self.gpu.as_ref().expect("open until dropped")
    }
}

impl Drop for TestGpu {
    fn drop(&mut self) {
        self.gpu = None;
        let messages = self.log.take();
        if !std::thread::panicking() {
            assert!(messages.is_empty(), "validation messages: {messages:#?}");
        }
    }
}

/// Compiles GLSL with `glslangValidator`.
pub(crate) fn compile(source: &str) -> Vec<u32> {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let stem = format!("{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let (glsl, spirv): (PathBuf, PathBuf) = (folder.join(format!("{stem}.comp")), folder.join(format!("{stem}.spv")));
    std::fs::write(&glsl, source.trim_start()).expect("the target folder is writable");
    let output = Command::new("glslangValidator")
        .args(["--target-env", "vulkan1.2", "-o"])
        .args([&spirv, &glsl])
        .output()
        .expect("glslangValidator is installed");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    let bytes = std::fs::read(&spirv).expect("glslangValidator wrote its output");
    for file in [glsl, spirv] {
        std::fs::remove_file(file).expect("own files can be removed");
    }
    words(&bytes)
}

pub(crate) fn words(bytes: &[u8]) -> Vec<u32> {
    bytes.chunks_exact(4).map(|four| u32::from_ne_bytes([four[0], four[1], four[2], four[3]])).collect()
}

pub(crate) fn bytes(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_ne_bytes()).collect()
}

pub(crate) fn read_words(buffer: &Buffer, count: usize) -> Vec<u32> {
    let mut out = vec![0; count * 4];
    buffer.read(0, &mut out).expect("a readback buffer of that size");
    words(&out)
}

/// Push constants of [`AFFINE`].
pub(crate) fn affine_push(src: u64, dst: u64, count: u32, add: u32) -> Vec<u8> {
    let mut push = [src.to_ne_bytes(), dst.to_ne_bytes()].concat();
    push.extend(bytes(&[count, add]));
    push
}

/// Push constants of [`SPIN`].
pub(crate) fn spin_push(dst: u64, rounds: u32) -> Vec<u8> {
    [&dst.to_ne_bytes()[..], &bytes(&[rounds, 0])[..]].concat()
}

pub(crate) fn affine(gpu: &Arc<Gpu>, scale: u32) -> Pipeline {
    Pipeline::new(gpu, "affine", &compile(AFFINE), &[(0, scale)], 24).expect("the shader is valid")
}

pub(crate) fn spin(gpu: &Arc<Gpu>) -> Pipeline {
    Pipeline::new(gpu, "spin", &compile(SPIN), &[], 16).expect("the shader is valid")
}

/// Waits for a submission as long as a slow machine may need.
pub(crate) fn finish(submission: &Submission) {
    let done = submission.wait(Duration::from_secs(60)).expect("the device lives");
    assert!(done, "{} did not finish in a minute", submission.label());
}
