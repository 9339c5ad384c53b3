// SPDX-License-Identifier: Apache-2.0
//! Render products of a session: planned by the host's thread, written by the render thread.

use crate::film::picture::{self, PictureAttributes};
use crate::film::products::{self, ProductPlan};
use crate::job::RenderJob;
use crate::job::product::RenderProduct;
use crate::job::request::Severity;
use crate::job::shared::SharedState;
use crate::sync::lock;
use oocpt_core::scene::{LightEmitter, Snapshot};
use oocpt_core::settings::Settings;

/// The products of the last request, and what follows from them: planned once, so that warnings are told once.
#[derive(Debug, Default)]
pub(super) struct PlannedProducts {
    products: Vec<RenderProduct>,
    plan: ProductPlan,
}

impl PlannedProducts {
    /// The plan for these products; tells what is left out.
    pub(super) fn plan(&mut self, products: Vec<RenderProduct>, shared: &SharedState) -> &ProductPlan {
        if products != self.products {
            self.plan = products::plan(&products);
            for warning in &self.plan.warnings {
                shared.report(Severity::Warning, warning.clone());
            }
            self.products = products;
        }
        &self.plan
    }
}

/// How the picture of the current or last render was made.
pub(super) fn attributes(shared: &SharedState, settings: &Settings) -> PictureAttributes {
    let device = lock(&shared.device).clone().map(|device| (device.name, device.driver)).unwrap_or_default();
    picture::attributes(&lock(&shared.stats), &device.0, &device.1, settings)
}

/// Writes the products of a job whose picture is published.
pub(super) fn write(job: &RenderJob, shared: &SharedState) {
    let published = lock(&shared.published);
    if job.products.is_empty() || !published.shows(job.generation) {
        return;
    }
    let made = attributes(shared, &job.settings);
    let inputs = inputs(&job.snapshot);
    for file in job.products.iter() {
        let attributes: PictureAttributes = made.iter().cloned().chain(products::times(file)).collect();
        match products::write(file, &job.request, &published, (&attributes, job.names.as_deref()), &inputs) {
            Ok(warnings) => {
                for text in warnings {
                    shared.report(Severity::Warning, format!("{}: {text}", file.prim));
                }
                if file.is_temporary {
                    continue;
                }
                let [width, height] = job.request.part().size();
                let text = format!("{width} x {height}, {} channels", file.channels.len());
                shared.report(Severity::Status, format!("wrote {} ({text})", file.path.display()));
            }
            Err(error) => {
                shared.report(Severity::Error, format!("{}: the product is not written: {error}", file.prim));
            }
        }
    }
}

/// Names of the files that a scene reads.
fn inputs(snapshot: &Snapshot) -> Vec<&str> {
    let textures = snapshot.surfaces.textures.iter().map(|texture| &*texture.asset.resolved);
    let lights = snapshot.lights.iter().filter_map(|light| match &light.emitter {
        LightEmitter::Dome { texture } => texture.as_ref().map(|texture| &texture.asset),
        LightEmitter::Local(local) => local.texture.as_ref(),
        LightEmitter::Distant { .. } => None,
    });
    textures.chain(lights.map(|asset| &*asset.resolved)).filter(|name| !name.is_empty()).collect()
}
