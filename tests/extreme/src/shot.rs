// SPDX-License-Identifier: Apache-2.0
//! One render by the real renderer, and what it left behind. Never panics: what goes wrong is told.

use std::sync::Arc;
use std::time::Duration;

use oocpt_core::camera::Camera;
use oocpt_core::scene::SceneDb;
use oocpt_core::settings::{Settings, TraversalKind};
use oocpt_render::textures::ImageLibrary;
use oocpt_render::{AovKind, AovRequest, LightFiles, RenderRequest, Session, SessionOptions, Severity};

/// Longest wait for one render; what takes longer hangs.
const TIMEOUT: Duration = Duration::from_secs(300);

/// How to render.
#[derive(Clone, Debug)]
pub(crate) struct Way {
    pub(crate) samples: u32,
    pub(crate) bounces: u32,
    pub(crate) seed: u32,
    pub(crate) chunk_kib: u32,
    pub(crate) dome_seen: bool,
    /// Distances and ids, besides colour.
    pub(crate) planes: bool,
    pub(crate) color: bool,
}

impl Default for Way {
    fn default() -> Self {
        Self { samples: 1, bounces: 0, seed: 0, chunk_kib: 8192, dome_seen: true, planes: false, color: true }
    }
}

/// Device and validation of all renders.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bench {
    pub(crate) device: String,
    pub(crate) validation: bool,
}

/// How a stage renders, besides what [`Way`] says.
#[derive(Clone, Debug, Default)]
pub(crate) struct Engine {
    /// The scene streams, with this many KiB for its geometry.
    pub(crate) streaming_kib: Option<u32>,
    /// Who walks the rays.
    pub(crate) traversal: TraversalKind,
    /// Where textures come from.
    pub(crate) images: Option<Arc<dyn ImageLibrary>>,
}

/// Images, bottom row first.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shot {
    pub(crate) color: Vec<[f32; 4]>,
    /// Window depth.
    pub(crate) depth: Vec<f32>,
    pub(crate) distance: Vec<f32>,
    pub(crate) prim: Vec<i32>,
    pub(crate) face: Vec<i32>,
    pub(crate) normal: Vec<[f32; 3]>,
    pub(crate) warnings: Vec<String>,
    pub(crate) errors: Vec<String>,
    pub(crate) hung: bool,
    /// Pixels that are not finite, and samples that were dropped for it.
    pub(crate) nonfinite: u64,
    pub(crate) device: String,
    /// The device's memory is the host's, so that the host can walk its rays.
    pub(crate) host_memory: bool,
}

/// A session to render with; the scene may be edited between renders.
pub(crate) struct Stage {
    session: Session,
}

impl Bench {
    pub(crate) fn stage(&self, build: impl FnOnce(&mut SceneDb)) -> Stage {
        self.stage_by(Engine::default(), build)
    }

    pub(crate) fn stage_by(&self, engine: Engine, build: impl FnOnce(&mut SceneDb)) -> Stage {
        // Subdivision surfaces stay cages: smooth normals on facets are what some cases are about.
        let settings = Settings {
            device: self.device.clone(),
            interactive: false,
            dicing_rate: 0.0,
            traversal: engine.traversal,
            geometry_budget_kib: engine.streaming_kib.unwrap_or(0),
            ..Settings::default()
        };
        let options = SessionOptions {
            validation: self.validation,
            force_streaming: engine.streaming_kib.is_some(),
            ..SessionOptions::default()
        };
        let session = Session::with_options(settings, options);
        let session = match engine.images {
            Some(images) => session.with_images(images),
            None => session,
        };
        session.with_scene(build);
        Stage { session }
    }
}

impl Stage {
    pub(crate) fn edit(&self, edit: impl FnOnce(&mut SceneDb)) {
        self.session.with_scene(edit);
    }

    /// Says who reads the pictures of lights.
    pub(crate) fn set_files(&self, files: Arc<dyn LightFiles>) {
        self.session.set_light_files(files);
    }

    pub(crate) fn take(&self, camera: &Camera, way: &Way) -> Shot {
        use oocpt_core::settings::SettingValue;
        let mut shot = Shot::default();
        let whole = |value: u32| SettingValue::Int(i64::from(value));
        let wanted = [
            ("oocpt:samplesPerPixel", whole(way.samples)),
            ("oocpt:maxBounces", whole(way.bounces)),
            ("oocpt:seed", whole(way.seed)),
            ("oocpt:chunkSize", whole(way.chunk_kib)),
            ("domeLightCameraVisibility", SettingValue::Bool(way.dome_seen)),
        ];
        for (key, value) in wanted {
            if let Err(error) = self.session.set_setting(key, value) {
                shot.errors.push(error.to_string());
            }
        }
        let request = request(camera, way);
        self.session.render(request.clone());
        shot.hung = !self.session.wait_converged(TIMEOUT);
        for message in self.session.take_messages() {
            let to = if message.severity == Severity::Error { &mut shot.errors } else { &mut shot.warnings };
            to.push(message.text);
        }
        let report = self.session.device_report();
        shot.host_memory = report.as_ref().is_some_and(|report| report.host_memory);
        shot.device = report.map(|report| report.name).unwrap_or_default();
        shot.nonfinite = self.session.stats().nonfinite_samples;
        self.read(&request, way, &mut shot);
        shot
    }

    fn read(&self, request: &RenderRequest, way: &Way, shot: &mut Shot) {
        if way.color {
            shot.color = self.image(request, AovKind::Color, shot);
        }
        if way.planes {
            shot.depth = self.image(request, AovKind::Depth, shot);
            shot.distance = self.image(request, AovKind::CameraDepth, shot);
            shot.prim = self.image(request, AovKind::PrimId, shot);
            shot.face = self.image(request, AovKind::ElementId, shot);
            shot.normal = self.image(request, AovKind::Normal, shot);
        }
        let bad = |values: &[f32]| values.iter().filter(|v| !v.is_finite()).count() as u64;
        shot.nonfinite += bad(shot.color.as_flattened()) + bad(shot.normal.as_flattened());
        shot.nonfinite += bad(&shot.depth) + bad(&shot.distance);
    }

    fn image<T: bytemuck::Pod>(&self, request: &RenderRequest, kind: AovKind, shot: &mut Shot) -> Vec<T> {
        let pixels = usize::try_from(request.pixels()).unwrap_or(0);
        let mut image = vec![T::zeroed(); pixels];
        if !self.session.read_aov(kind, bytemuck::cast_slice_mut(&mut image)) {
            shot.errors.push(format!("{kind:?} was not published"));
        }
        image
    }
}

fn request(camera: &Camera, way: &Way) -> RenderRequest {
    let [x0, y0, x1, y1] = camera.data_window;
    let mut aovs = Vec::new();
    let mut want = |kind, clear| aovs.push(AovRequest { kind, clear });
    if way.color {
        want(AovKind::Color, [0.0; 4]);
    }
    if way.planes {
        want(AovKind::Depth, [1.0, 0.0, 0.0, 0.0]);
        want(AovKind::CameraDepth, [0.0; 4]);
        want(AovKind::PrimId, [-1.0, 0.0, 0.0, 0.0]);
        want(AovKind::ElementId, [-1.0, 0.0, 0.0, 0.0]);
        want(AovKind::Normal, [0.0; 4]);
    }
    RenderRequest { width: x0.abs_diff(x1), height: y0.abs_diff(y1), camera: camera.clone(), aovs, window: None }
}
