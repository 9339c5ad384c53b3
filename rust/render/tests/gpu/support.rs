// SPDX-License-Identifier: Apache-2.0
//! The helpers of the tests: one session, one request, every image, no message unnoticed.

use glam::{DMat4, DVec3, DVec4};
use oocpt_core::camera::Camera;
use oocpt_core::scene::{SceneDb, Snapshot};
use oocpt_core::settings::{Settings, TraversalKind};
use oocpt_render::{AovKind, AovRequest, Message, RenderRequest, Session, SessionOptions};
use std::sync::Arc;
use std::time::Duration;

/// Longest wait for one render: it only ends tests that hang, so a busy machine may take its time compiling.
pub(crate) const TIMEOUT: Duration = Duration::from_secs(300);

/// Settings of the tests: few samples, one seed, images other than the colour through pixel centres, for closed forms;
/// rays walked by the shaders, or by the host if `OOCPT_TEST_TRAVERSAL` says so: any test must pass with either.
/// `OOCPT_TEST_DEVICE` names the device.
pub(crate) fn settings(samples: u32, bounces: u32) -> Settings {
    let said = std::env::var("OOCPT_TEST_TRAVERSAL").ok();
    let traversal = said.and_then(|name| TraversalKind::named(&name)).unwrap_or(TraversalKind::Compute);
    let device = std::env::var("OOCPT_TEST_DEVICE").unwrap_or_default();
    let defaults = Settings { device, traversal, ..Settings::default() };
    Settings { samples_per_pixel: samples, max_bounces: bounces, interactive: false, filter_aovs: false, ..defaults }
}

/// The same settings, with images filtered with the samples as users have them.
pub(crate) fn filtering(settings: Settings) -> Settings {
    Settings { filter_aovs: true, ..settings }
}

/// The number of seeds that a test counts over: a few, or, by `cargo xtask test --full`, many.
pub(crate) fn seeds([few, many]: [u32; 2]) -> u32 {
    if is_full() { many } else { few }
}

/// The first values of a test, or, by `cargo xtask test --full`, all.
pub(crate) fn few_of<T>(all: &[T], few: usize) -> &[T] {
    if is_full() { all } else { &all[..few] }
}

/// Returns true if the tests run by `cargo xtask test --full`.
pub(crate) fn is_full() -> bool {
    std::env::var_os("OOCPT_TEST_FULL").is_some()
}

/// A session whose Vulkan mistakes are errors.
pub(crate) fn session(settings: Settings) -> Session {
    Session::with_options(settings, SessionOptions { validation: true, ..SessionOptions::default() })
}

/// Perspective camera at `eye` looking at `target`; vertical field of view in radians.
pub(crate) fn perspective(eye: DVec3, target: DVec3, fov: f64, size: [u32; 2]) -> Camera {
    let (near, far) = (0.1, 1000.0);
    let scale = 1.0 / (0.5 * fov).tan();
    let aspect = f64::from(size[0]) / f64::from(size[1]);
    let projection = DMat4::from_cols(
        DVec4::new(scale / aspect, 0.0, 0.0, 0.0),
        DVec4::new(0.0, scale, 0.0, 0.0),
        DVec4::new(0.0, 0.0, (far + near) / (near - far), -1.0),
        DVec4::new(0.0, 0.0, 2.0 * far * near / (near - far), 0.0),
    );
    camera(eye, target, projection, size)
}

/// Orthographic camera that sees `height` scene units.
pub(crate) fn orthographic(eye: DVec3, target: DVec3, height: f64, size: [u32; 2]) -> Camera {
    let (near, far) = (0.1, 1000.0);
    let aspect = f64::from(size[0]) / f64::from(size[1]);
    let projection = DMat4::from_cols(
        DVec4::new(2.0 / (height * aspect), 0.0, 0.0, 0.0),
        DVec4::new(0.0, 2.0 / height, 0.0, 0.0),
        DVec4::new(0.0, 0.0, 2.0 / (near - far), 0.0),
        DVec4::new(0.0, 0.0, (far + near) / (near - far), 1.0),
    );
    camera(eye, target, projection, size)
}

#[expect(clippy::cast_precision_loss, clippy::cast_possible_wrap, reason = "images of tests are small")]
fn camera(eye: DVec3, target: DVec3, projection: DMat4, size: [u32; 2]) -> Camera {
    let back = (eye - target).normalize();
    let right = DVec3::Y.cross(back).normalize();
    let up = back.cross(right);
    Camera {
        world_from_view: DMat4::from_cols(right.extend(0.0), up.extend(0.0), back.extend(0.0), eye.extend(1.0)),
        projection,
        display_window: [0.0, 0.0, size[0] as f32, size[1] as f32],
        data_window: [0, 0, size[0] as i32, size[1] as i32],
        lens_radius: 0.0,
        focus_distance: 0.0,
        clip_planes: Vec::new(),
        motion: Vec::new(),
        exposure_scale: 1.0,
    }
}

/// The images that the renderer makes itself, but for ranks of ids and those that depend on the timing of loads.
pub(crate) fn own_images() -> impl Iterator<Item = AovKind> {
    let others = [AovKind::Denoised, AovKind::LoadWaits];
    AovKind::ALL.into_iter().filter(move |kind| !others.contains(kind) && !kind.ranks_ids())
}

/// A request for every image of the renderer's own, with Hydra's usual clear values.
pub(crate) fn request(camera: Camera) -> RenderRequest {
    let [x0, y0, x1, y1] = camera.data_window;
    let clear = |kind| match kind {
        AovKind::Depth => [1.0, 0.0, 0.0, 0.0],
        kind if AovKind::is_id(kind) => [-1.0, 0.0, 0.0, 0.0],
        _ => [0.0; 4],
    };
    RenderRequest {
        width: x0.abs_diff(x1),
        height: y0.abs_diff(y1),
        camera,
        aovs: own_images().map(|kind| AovRequest { kind, clear: clear(kind) }).collect(),
        window: None,
    }
}

/// A request for the colour alone: the passes of the other images are not compiled, which takes a software renderer
/// long.
pub(crate) fn color_request(camera: Camera) -> RenderRequest {
    let mut request = request(camera);
    request.aovs.retain(|aov| aov.kind == AovKind::Color);
    request
}

/// Renders and waits; panics on any message, since these scenes are meant to be clean.
pub(crate) fn render(session: &Session, request: &RenderRequest) {
    session.render(request.clone());
    let converged = session.wait_converged(TIMEOUT);
    let messages = session.take_messages();
    assert!(messages.is_empty(), "unexpected messages: {messages:#?}");
    assert!(converged, "the render did not end in time: {:?}", session.stats());
}

/// Renders and waits; returns the messages.
pub(crate) fn render_with_messages(session: &Session, request: &RenderRequest) -> Vec<Message> {
    session.render(request.clone());
    assert!(session.wait_converged(TIMEOUT), "the render did not end in time: {:?}", session.stats());
    session.take_messages()
}

/// An image as 32-bit words of one kind.
pub(crate) fn read<T: bytemuck::Pod>(session: &Session, request: &RenderRequest, kind: AovKind) -> Vec<T> {
    let bytes = usize::try_from(request.image_pixels()).expect("small") * kind.pixel_bytes();
    let mut pixels = vec![T::zeroed(); bytes / size_of::<T>()];
    assert!(session.read_aov(kind, bytemuck::cast_slice_mut(&mut pixels)), "{kind:?} was not published");
    pixels
}

/// All images of the renderer's own as bytes, one after the other.
pub(crate) fn read_all(session: &Session, request: &RenderRequest) -> Vec<Vec<u8>> {
    own_images().map(|kind| read::<u8>(session, request, kind)).collect()
}

/// Renders a scene in a session of its own and returns all images.
pub(crate) fn images(build: impl FnOnce(&mut SceneDb), settings: Settings, request: &RenderRequest) -> Vec<Vec<u8>> {
    let session = session(settings);
    session.with_scene(build);
    render(&session, request);
    read_all(&session, request)
}

/// The snapshot that `build` makes.
pub(crate) fn snapshot(build: impl FnOnce(&mut SceneDb)) -> Arc<Snapshot> {
    let mut db = SceneDb::new();
    build(&mut db);
    let commit = db.commit();
    assert!(commit.warnings.is_empty(), "the scene is meant to be clean: {:?}", commit.warnings);
    commit.snapshot
}
