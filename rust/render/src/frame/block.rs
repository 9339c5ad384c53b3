// SPDX-License-Identifier: Apache-2.0
//! Builds the frame block: camera, lights, settings and addresses, which every pass reads.

use crate::assets::SceneView;
use crate::frame::context::{FrameContext, kind_limits};
use bytemuck::Zeroable;
use oocpt_abi::{FrameConstants, FrameFlags};

/// Albedo of a surface without a colour, as `UsdPreviewSurface`'s diffuseColor.
const DEFAULT_ALBEDO: [f32; 3] = [0.18; 3];

/// Threads that trace the rays of a round, at most: more than devices run at a time (an H200 runs 118 000), few enough
/// for rays to be left for those whose walks end early.
const MAX_WALKERS: u32 = 1 << 18;

/// The constant that is added to the square of a pixel before an error is divided by it: 0.01 in the picture (Rousselle
/// et al. 2011), which is the film times the exposure. Bounded, so that relative errors are finite for every exposure.
pub(crate) fn error_floor(exposure: f32) -> f32 {
    (1e-2 / (exposure * exposure)).clamp(1e-30, 1e30)
}

fn flags(context: &FrameContext<'_>) -> FrameFlags {
    let mut flags = FrameFlags::empty();
    flags.set(FrameFlags::DOME_CAMERA_VISIBLE, context.lights.background_visible());
    flags.set(FrameFlags::FIRST_HITS, !context.film.has_light());
    flags.set(FrameFlags::PARTED_SHADOWS, context.lights.parts_shadows);
    flags
}

/// The frame block of a frame; path memory is bound by its owner.
pub(crate) fn frame_block(context: &FrameContext<'_>, scene: &SceneView) -> FrameConstants {
    let FrameContext { job, lights, rays, film, .. } = *context;
    let exposure = job.request.camera.exposure();
    let part = job.request.part();
    let mut block = FrameConstants {
        top_nodes: scene.top_nodes,
        chunk_instances: scene.chunk_instances,
        chunks: scene.chunks,
        assemblies: scene.assemblies,
        meshes: scene.meshes,
        textures: scene.textures,
        texture_pages: scene.texture_pages,
        ray_o: rays.o,
        ray_o_lo: rays.o_lo,
        ray_o_x: rays.o_x,
        ray_o_y: rays.o_y,
        ray_d: rays.d,
        ray_d_x: rays.d_x,
        ray_d_y: rays.d_y,
        lens_u: rays.lens_u,
        lens_v: rays.lens_v,
        origin: job.snapshot.origin.as_vec3().to_array(),
        origin_lo: (job.snapshot.origin - job.snapshot.origin.as_vec3().as_dvec3()).as_vec3().to_array(),
        focus: rays.focus,
        clip_z: rays.clip_z,
        clip_w: rays.clip_w,
        pixel_x: rays.pixel_x,
        pixel_y: rays.pixel_y,
        view: rays.view_from_world,
        view_normal: rays.view_normal,
        default_albedo: DEFAULT_ALBEDO,
        clamp: job.settings.clamp,
        width: part.width,
        height: part.height,
        window_x: part.x,
        window_y: part.y,
        picture_width: job.request.width,
        picture_height: job.request.height,
        seed: job.settings.seed,
        max_bounces: job.settings.max_bounces,
        kind_limits: kind_limits(&job.settings),
        flags: flags(context).bits(),
        most_walkers: MAX_WALKERS,
        materials: scene.materials,
        prims: scene.prims,
        material_slots: scene.material_slots,
        programs: scene.programs,
        placed_values: scene.placed_values,
        lighting: context.lighting,
        prim_masks: context.tables.prim_masks,
        mask_count: lights.mask_count,
        exposure,
        error_floor: error_floor(exposure),
        ..FrameConstants::zeroed()
    };
    film.bind(&mut block, &job.request.aovs);
    for (name, primvar) in block.primvar_names.iter_mut().zip(film.primvars()) {
        *name = job.snapshot.surfaces.primvar_number(&primvar.name());
    }
    block
}
