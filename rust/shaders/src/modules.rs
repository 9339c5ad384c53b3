// SPDX-License-Identifier: Apache-2.0
//! The compiled passes, as `build.rs` left them.
//!
//! Guarantees: every `shaders/**/NAME.comp` is here, compiled for Vulkan 1.2 and accepted by spirv-val. Any thread.

use std::borrow::Cow;

/// A compiled pass; its entry point is `main`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ShaderModule {
    /// Name of the pass: the file name, with its folder before it but for `shaders/wavefront`.
    pub name: &'static str,
    /// SPIR-V.
    pub words: &'static [u32],
    /// The features that it asks for: all others leave it as it is, so scenes that differ in them share its pipelines.
    pub features: oocpt_abi::Features,
    /// Whether it reads [`oocpt_abi::SPEC_MAX_LEVELS`].
    pub reads_levels: bool,
    /// Whether it reads [`oocpt_abi::SPEC_STACK_SIZE`].
    pub reads_stack: bool,
}

impl ShaderModule {
    /// The words for a driver that is given the specialisation constants `(id, value)`, without what these make
    /// unreachable.
    #[must_use]
    pub fn specialised(&self, spec: &[(u32, u32)]) -> Cow<'static, [u32]> {
        crate::fold::fold(self.words, spec).map_or(Cow::Borrowed(self.words), Cow::Owned)
    }
}

/// The bytes of a file as words; a length that is no multiple of 4, or a file that is no SPIR-V, does not compile.
const fn to_words<const WORDS: usize>(bytes: &[u8]) -> [u32; WORDS] {
    assert!(bytes.len() == WORDS * 4, "length of a SPIR-V file");
    let mut words = [0; WORDS];
    let mut index = 0;
    while index < WORDS {
        let at = index * 4;
        words[index] = u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        index += 1;
    }
    assert!(WORDS > 5 && words[0] == 0x0723_0203, "SPIR-V magic number");
    words
}

macro_rules! words {
    ($name:literal) => {{
        const BYTES: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/", $name, ".spv"));
        static WORDS: [u32; BYTES.len() / 4] = super::to_words(BYTES);
        &WORDS
    }};
}

include!(concat!(env!("OUT_DIR"), "/modules.rs"));
