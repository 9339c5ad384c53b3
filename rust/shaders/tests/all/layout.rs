// SPDX-License-Identifier: Apache-2.0
//! The layout check: it passes on the shaders as they are, and it sees every kind of difference.

#[path = "../../build/check.rs"]
mod check;

use check::{HostLayout, HostMember};
use oocpt_abi::LAYOUTS;
use oocpt_shaders::{ALL, ShaderModule, passes};
use std::collections::BTreeSet;

fn layouts() -> Vec<HostLayout> {
    let member = |name: &str, offset: usize, size: usize| HostMember {
        name: name.to_owned(),
        offset: offset as u64,
        size: size as u64,
    };
    LAYOUTS
        .iter()
        .map(|layout| HostLayout {
            name: layout.name.to_owned(),
            size: layout.size as u64,
            members: layout.members.iter().map(|m| member(m.name, m.offset, m.size)).collect(),
        })
        .collect()
}

/// The error that `check` gives for `module` after `plant` has changed what Rust says of the struct `name`.
fn planted(module: &ShaderModule, name: &str, plant: impl FnOnce(&mut HostLayout)) -> String {
    let mut layouts = layouts();
    plant(layouts.iter_mut().find(|layout| layout.name == name).expect("known struct"));
    check::check(module.words, &layouts).expect_err("the planted difference must be seen")
}

#[test]
fn shaders_agree_with_rust() {
    let mut seen = BTreeSet::new();
    for module in ALL {
        seen.extend(check::check(module.words, &layouts()).expect(module.name));
    }
    for name in [
        "FrameConstants",
        "PushConstants",
        "WavefrontCounters",
        "GpuInstance",
        "GpuMesh",
        "GpuInfiniteLight",
        "FilmPixel",
    ] {
        assert!(seen.contains(name), "{name} is in no pass");
    }
}

#[test]
fn a_moved_member_is_seen() {
    let error = planted(&passes::SHADE_SURFACE, "FrameConstants", |frame| {
        frame.members.iter_mut().find(|m| m.name == "focus").expect("member").offset += 4;
    });
    assert!(error.contains("focus"), "{error}");
}

#[test]
fn a_renamed_member_is_seen() {
    let error = planted(&passes::ACCUMULATE, "FilmPixel", |film| film.members.swap(0, 1));
    assert!(error.contains("compensation"), "{error}");
}

#[test]
fn a_member_of_another_size_is_seen() {
    let error = planted(&passes::SHADE_SURFACE, "GpuInfiniteLight", |light| light.members[0].size = 16);
    assert!(error.contains("direction"), "{error}");
}

#[test]
fn a_missing_member_is_seen() {
    let mut left = 0;
    let error = planted(&passes::PREPARE_DISPATCH, "WavefrontCounters", |counters| {
        counters.members.pop();
        left = counters.members.len();
    });
    assert!(error.contains(&format!("{} members in GLSL, {left} in Rust", left + 1)), "{error}");
}

#[test]
fn another_array_stride_is_seen() {
    let error = planted(&passes::INTERSECT_CLOSEST, "GpuInstance", |instance| instance.size = 80);
    assert!(error.contains("array stride 64"), "{error}");
}

#[test]
fn an_unknown_struct_is_seen() {
    let mut layouts = layouts();
    layouts.retain(|layout| layout.name != "PushConstants");
    let error = check::check(passes::RESOLVE.words, &layouts).expect_err("PushConstants is unknown");
    assert!(error.contains("PushConstants: in memory, but Rust does not know it"), "{error}");
}
