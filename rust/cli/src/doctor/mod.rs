// SPDX-License-Identifier: Apache-2.0
//! `oocpt doctor`: what this machine can render with; with `--scene`, what a scene needs of the renderer ([`scene`]).

mod host;
mod needs;
mod scene;
mod table;

use anyhow::Result;
use oocpt_gpu::{DeviceReport, enumerate_for};

/// Options of `oocpt doctor`.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Device to select: an index or a part of its name.
    #[arg(long, env = "OOCPT_DEVICE")]
    device: Option<String>,
    #[command(flatten)]
    scene: scene::SceneCheckOptions,
}

/// Prints the report; fails when no device can be used.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    if let Some(name) = &arguments.scene.scene {
        return scene::run(name, &arguments.scene, arguments.device.as_deref().unwrap_or_default());
    }
    println!("OocPT {}", env!("CARGO_PKG_VERSION"));
    let selector = arguments.device.as_deref().filter(|text| !text.is_empty());
    let devices = enumerate_for(selector)?;
    for device in &devices {
        print!("{}", describe(device));
    }
    match devices.iter().find(|device| device.chosen) {
        Some(device) => println!("will use: [{}] {} ({})", device.index, device.name, device.why),
        None => {
            let wanted = selector.map(|text| format!(" that matches OOCPT_DEVICE={text}")).unwrap_or_default();
            anyhow::bail!("no usable Vulkan device{wanted}{}", advice(&devices));
        }
    }
    Ok(())
}

/// What each device lacks, and what helps.
fn advice(devices: &[DeviceReport]) -> String {
    let lacks = |device: &DeviceReport| format!("{} lacks {}", device.name, device.missing.join(", "));
    let lacking: Vec<String> = devices.iter().filter(|device| !device.missing.is_empty()).map(lacks).collect();
    let lacking = if lacking.is_empty() { String::new() } else { format!(" ({})", lacking.join("; ")) };
    format!("{lacking}: install a newer driver, or Mesa's lavapipe (mesa-vulkan-drivers)")
}

fn describe(device: &DeviceReport) -> String {
    let mark = if device.chosen { '*' } else { ' ' };
    let mut lines =
        vec![("kind", format!("{:?}", device.kind)), ("driver", device.driver.clone()), ("Vulkan", device.api.clone())];
    for heap in &device.heaps {
        let place = if heap.device_local { "device memory" } else { "host memory" };
        let free = heap.free.map(|bytes| format!(", {} MiB free", bytes >> 20)).unwrap_or_default();
        lines.push((place, format!("{} MiB{free}", heap.bytes >> 20)));
    }
    let traversal = if device.host_memory { "native: the device is a processor" } else { "compute shaders" };
    lines.push(("traversal", format!("{traversal} (oocpt:traversal = auto)")));
    lines.push(("capabilities", format!("{:?}", device.capabilities)));
    let missing = if device.missing.is_empty() { "nothing".into() } else { device.missing.join(", ") };
    lines.push(("missing", missing));
    lines.push(("verdict", device.why.clone()));
    let lines: Vec<String> = lines.iter().map(|(label, value)| format!("    {label:<14}{value}\n")).collect();
    format!("{mark} [{}] {}\n{}", device.index, device.name, lines.concat())
}
