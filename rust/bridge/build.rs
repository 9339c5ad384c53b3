// SPDX-License-Identifier: Apache-2.0
//! Generates and compiles the C++ half of the bridge. It needs no USD header: `HeldArray` is an abstract class here.

use std::path::PathBuf;

fn main() {
    let cpp = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../cpp");
    let bridges = ["src/lib.rs", "src/ffi_images.rs", "src/ffi_runner.rs"];
    cxx_build::bridges(bridges)
        .std("c++17")
        .include(&cpp)
        .flag_if_supported("-fvisibility=hidden")
        .flag_if_supported("-fvisibility-inlines-hidden")
        .compile("oocpt_bridge_cxx");
    for bridge in bridges {
        println!("cargo:rerun-if-changed={bridge}");
    }
    for header in ["bridge/heldArray.h", "bridge/heldImage.h"] {
        println!("cargo:rerun-if-changed={}", cpp.join(header).display());
    }
}
