// SPDX-License-Identifier: Apache-2.0
//! The table of passes: the one declaration of every wavefront pass.
//!
//! Compilation, recording, the inventory of a render, the table of `shaders/README.md` and the tests of the passes are
//! derived from it. A pass has one name: its shader is `shaders/wavefront/NAME.comp`, and it appears under `NAME` in
//! timings, debuggers and errors. Pure, any thread.

use crate::{ShaderModule, modules::passes};
use oocpt_abi::{Features, WavefrontCounters};

/// The condition under which a frame has a pass: all members must hold.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PassCondition {
    /// All of these features are needed.
    pub with: Features,
    /// None of these features may be present.
    pub without: Features,
    /// This image must be wanted.
    pub image: Option<PassImage>,
}

/// Images that need passes of their own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PassImage {
    /// Some plane that is traced through pixel centres.
    PixelCentres,
    /// Some plane that is a mean of what samples meet first, or of the light of a path expression.
    Filtered,
    /// Some plane that ranks the ids of what samples meet first.
    RankedIds,
    /// A deep image.
    Deep,
    /// Some plane of one of these three kinds, or that of pixel centres.
    FirstHits,
    /// `variance` or `error`.
    Spread,
    /// `sampleCount`.
    SampleCount,
    /// No image, but sums that merge with those of other renders.
    ExactSums,
}

impl PassCondition {
    const ALWAYS: Self = Self { with: Features::empty(), without: Features::empty(), image: None };

    const fn with(features: Features) -> Self {
        Self { with: features, ..Self::ALWAYS }
    }

    const fn without(self, features: Features) -> Self {
        Self { without: features, ..self }
    }

    const fn image(image: PassImage) -> Self {
        Self { image: Some(image), ..Self::ALWAYS }
    }

    /// Returns true if a frame with these features has the pass; `wants` returns true for the images it wants.
    pub fn holds(&self, features: Features, wants: impl Fn(PassImage) -> bool) -> bool {
        features.contains(self.with) && !features.intersects(self.without) && self.image.is_none_or(wants)
    }
}

/// The number of threads of a dispatch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DispatchSize {
    /// The number that the host gives; described in words.
    Direct(&'static str),
    /// The workgroups of the `IndirectArgs` at this offset of [`WavefrontCounters`].
    Indirect(u64),
}

/// A row of [`PASSES`].
#[derive(Debug, Clone, Copy)]
pub struct PassInfo {
    /// The pass.
    pub pass: Pass,
    /// Its shader.
    pub module: &'static ShaderModule,
    /// The condition under which a frame has it.
    pub when: PassCondition,
    /// The size of its dispatch, if it is always launched in the same way.
    pub launch: DispatchSize,
    /// The data of a frame that it reads, in words.
    pub reads: &'static str,
    /// The data that it writes, in words.
    pub writes: &'static str,
}

macro_rules! passes {
    ($($(#[doc = $doc:literal])+ $pass:ident = $module:ident, $when:expr, $launch:expr, $reads:literal => $writes:literal;)+) => {
        /// The wavefront passes.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Pass {
            $($(#[doc = $doc])+ $pass,)+
        }

        /// Every wavefront pass, in the order of [`Pass`].
        pub static PASSES: [PassInfo; [$(Pass::$pass),+].len()] = [$(PassInfo {
            pass: Pass::$pass,
            module: &passes::$module,
            when: $when,
            launch: $launch,
            reads: $reads,
            writes: $writes,
        }),+];
    };
}

use DispatchSize::{Direct, Indirect};
use PassCondition as When;

const STREAMING: Features = Features::STREAMING;
const ROULETTE: Features = STREAMING.union(Features::ROULETTE);
const TEXTURES: Features = STREAMING.union(Features::TEXTURES);

passes! {
    /// Starts the paths of a wave or segment with their camera rays.
    GenerateCameraRays = GENERATE_CAMERA_RAYS, When::ALWAYS, Direct("paths of the wave or segment"),
        "FrameConstants; streaming: `free_slots`"
        => "`rays`, `paths`, `radiance` = 0, `ray_queue`, `ray_count`; streaming: `segments`, `places`, `progress`";
    /// Starts rays through pixel centres.
    GenerateAovRays = GENERATE_AOV_RAYS, When::image(PassImage::PixelCentres), Direct("paths of the wave or segment"),
        "as `generate_camera_rays`" => "the same but for `radiance`";
    /// Writes the arguments of the passes that come next.
    PrepareDispatch = PREPARE_DISPATCH, When::ALWAYS, Direct("1"),
        "WavefrontCounters" => "WavefrontCounters: arguments, totals, and zero in the queues that come next";
    /// Finds the closest hit of each ray of a round.
    IntersectClosest = INTERSECT_CLOSEST, When::ALWAYS, Indirect(WavefrontCounters::TRACE_ARGS),
        "`ray_queue[r & 1]`, `rays`, scene; streaming: what waiting rays keep"
        => "`hits`; pushes to `surface_queue`, `escaped_queue` or `settle_queue[0]`; streaming: `progress`, pending \
            lists, flags of rays, pushes to `deferred`";
    /// Tests whether something is in the way of each shadow ray.
    IntersectShadow = INTERSECT_SHADOW, When::ALWAYS, Indirect(WavefrontCounters::SHADOW_ARGS),
        "`shadow_queue`, `shadow_rays`, scene; streaming: what waiting rays keep"
        => "adds to `radiance`, `light_values`; pushes to `settle_queue[1]`; streaming: as `intersect_closest`";
    /// Finds the closest hit of the rays whose hit depends on a cutout's texture.
    SettleClosest = SETTLE_CLOSEST, When::with(Features::DEFERRED_CUTOUTS),
        Indirect(WavefrontCounters::SETTLE_CLOSEST_ARGS),
        "`settle_queue[0]`, `settle_hits[0]`, `hits`, `rays`, scene, textures"
        => "`hits`; pushes to `surface_queue` or `escaped_queue`; requests of tiles";
    /// Tests the shadow rays that met only candidates that depend on a cutout's texture.
    SettleShadow = SETTLE_SHADOW, When::with(Features::DEFERRED_CUTOUTS),
        Indirect(WavefrontCounters::SETTLE_SHADOW_ARGS),
        "`settle_queue[1]`, `settle_hits[1]`, `shadow_rays`, scene, textures"
        => "adds to `radiance`, `light_values`; requests of tiles";
    /// Keeps the surfaces that rays met in this round.
    RecordSurfaces = RECORD_SURFACES, When::with(STREAMING), Indirect(WavefrontCounters::RAY_ARGS),
        "`ray_queue[r & 1]`, `hits`, scene" => "`surfaces` of hits found in this round";
    /// Evaluates the materials of surfaces.
    ResolveMaterials = RESOLVE_MATERIALS, When::with(TEXTURES).without(Features::MESH_LIGHT_VALUES),
        Indirect(WavefrontCounters::RESOLVE_ARGS),
        "`resolve_queue`, `surfaces`, textures"
        => "`resolved`, `resolve_progress`; pushes to `surface_queue` or `deferred`";
    /// Replaces `resolve_materials` if the emission of lights is a texture's or a primvar's.
    ResolveLights = RESOLVE_LIGHTS, When::with(TEXTURES.union(Features::MESH_LIGHT_VALUES)),
        Indirect(WavefrontCounters::RESOLVE_ARGS),
        "the same, and lights" => "the same; the last lookups are the emission of the light that will be asked";
    /// Adds the emission of lights at infinity to rays that leave the scene.
    ShadeBackground = SHADE_BACKGROUND, When::ALWAYS, Indirect(WavefrontCounters::ESCAPED_ARGS),
        "`escaped_queue`, `rays`, `paths`, lights" => "adds to `radiance`, `light_values`; streaming: `progress`, `segments`, \
            `free_slots`";
    /// Shades the surfaces that rays met: light, the next ray, a shadow ray.
    ShadeSurface = SHADE_SURFACE, When::ALWAYS, Indirect(WavefrontCounters::SURFACE_ARGS),
        "`surface_queue`, `rays`, `paths`, lights, and `hits` and scene, or with streaming `surfaces`"
        => "`paths`, `rays`, `shadow_rays`, `path_states`, `shadow_states`; `radiance` and `light_values`; pushes to `shadow_queue`, \
            `ray_queue[(r + 1) & 1]`; streaming: as `shade_background`";
    /// Writes the planes that are traced through pixel centres, and what samples have for the filtered ones.
    ShadeAovs = SHADE_AOVS, When::image(PassImage::FirstHits), Direct("indirect `SURFACE_ARGS`, then `ESCAPED_ARGS`"),
        "the queue, and `hits` and scene, or with streaming `surfaces`"
        => "the planes of `FrameConstants::aov` that are not 0; of samples, `plane_values`";
    /// Adds what the samples of a wave or segment have for filtered planes to their sums.
    SumPlanes = SUM_PLANES, When::image(PassImage::Filtered), Direct("`min(path_count, width * height)`"),
        "`plane_values`, `film`" => "`plane_sums`";
    /// Counts the samples of a wave or segment in the slots of what they met.
    RankIds = RANK_IDS, When::image(PassImage::RankedIds), Direct("`min(path_count, width * height)`"),
        "`plane_values`" => "`id_slots`";
    /// Adds the samples of a wave or segment to the deep samples of their pixels.
    MergeDeep = MERGE_DEEP, When::image(PassImage::Deep), Direct("`min(path_count, width * height)`"),
        "`plane_values`, `radiance`; streaming: `ended_radiance`" => "`deep_slots`";
    /// Adds the samples of a wave or segment to the film.
    Accumulate = ACCUMULATE, When::ALWAYS, Direct("`min(path_count, width * height)`"),
        "`radiance`; streaming: `ended_radiance`" => "`film`";
    /// Adds the same samples to sums that do not depend on their order.
    SumExact = SUM_EXACT, When::image(PassImage::ExactSums), Direct("`min(path_count, width * height)`"),
        "as `accumulate`" => "`ExactPixel` of each pixel, behind the film";
    /// Writes the number of samples of each pixel.
    CountSamples = COUNT_SAMPLES, When::image(PassImage::SampleCount), Direct("`width * height`"),
        "`film`" => "its plane of `FrameConstants::aov`";
    /// Writes the filtered planes.
    ResolvePlanes = RESOLVE_PLANES, When::image(PassImage::Filtered), Direct("`width * height`"),
        "`plane_sums`, `film`" => "the filtered planes of `FrameConstants::aov`, those of shadows and waits, `primvar_images`, `light_images`";
    /// Writes the largest shares of each pixel by id.
    ResolveIds = RESOLVE_IDS, When::image(PassImage::RankedIds), Direct("`width * height`"),
        "`id_slots`, `film`" => "its planes of `FrameConstants::aov`";
    /// Writes the deep samples of each pixel.
    ResolveDeep = RESOLVE_DEEP, When::image(PassImage::Deep), Direct("`width * height`"),
        "`deep_slots`, `film`" => "`deep_image`";
    /// Writes the variance and the error of each pixel.
    TellSpread = TELL_SPREAD, When::image(PassImage::Spread), Direct("`width * height`"),
        "`film`" => "its planes of `FrameConstants::aov`";
    /// Estimates the error of the picture.
    MeasureError = MEASURE_ERROR, When::ALWAYS, Direct("at most 1024 workgroups"),
        "`film`" => "`ErrorSums` of each workgroup, behind the film";
    /// Resolves the film to the picture.
    Resolve = RESOLVE, When::ALWAYS, Direct("`width * height`"), "`film`, with shadow catchers `plane_sums`" => "`color`";
    /// Answers the deferred tests about cutouts that rays left.
    ResolveCutouts = RESOLVE_CUTOUTS, When::with(TEXTURES.union(Features::CUTOUTS)),
        Indirect(WavefrontCounters::DEFERRED_ARGS),
        "`deferred`, textures" => "`alpha_tests`";
    /// Counts the waiting rays that may go on, by chunk.
    SortDeferredCount = SORT_DEFERRED_COUNT, When::with(STREAMING), Indirect(WavefrontCounters::DEFERRED_ARGS),
        "`deferred`, pending lists, chunks, meshes" => "adds to `sort_counts`";
    /// Sums the counts of `SortDeferredCount`.
    SortDeferredScan = SORT_DEFERRED_SCAN, When::with(STREAMING), Direct("`sort_blocks` workgroups, then 1"),
        "`sort_counts`, `sort_sums`" => "the same; WavefrontCounters: room in the queues, the other list";
    /// Sends on the waiting rays that may go on, chunk by chunk.
    SortDeferredScatter = SORT_DEFERRED_SCATTER, When::with(STREAMING), Indirect(WavefrontCounters::DEFERRED_ARGS),
        "`deferred`, pending lists, chunks, meshes" => "`ray_queue`, `shadow_queue`, chunk by chunk; pushes to `deferred`";
    /// Counts waiting rays by unit.
    CountDemand = COUNT_DEMAND, When::with(STREAMING), Indirect(WavefrontCounters::DEFERRED_ARGS),
        "`deferred`, pending lists, chunks" => "adds to `demand`; pushes to `demanded`";
    /// Lists the units that rays wait for.
    ListDemand = LIST_DEMAND, When::with(STREAMING), Direct("at most 64 workgroups"),
        "`demanded`, `demand`" => "pushes to `demand_list`; `demand` = 0";
    /// Moves the radiance of ended paths out of their slots.
    RetirePaths = RETIRE_PATHS, When::with(STREAMING), Indirect(WavefrontCounters::RETIRE_ARGS),
        "`free_slots`, `places`, `radiance`, `light_values`" => "`ended_radiance`, `plane_values`";
    /// Estimates the level of radiance of the picture.
    RouletteLevel = ROULETTE_LEVEL, When::with(ROULETTE), Direct("64, for the last paths"),
        "`segments`, `ended_radiance`" => "`RouletteStats`";
    /// Estimates the contribution of waiting rays.
    RouletteWorth = ROULETTE_WORTH, When::with(ROULETTE), Indirect(WavefrontCounters::DEFERRED_ARGS),
        "`deferred`, pending lists, what the rays carry, `segments`, `ended_radiance`, `film`, `RouletteStats`"
        => "adds to `worth`, `worth_sums`";
    /// Weights or ends the rays that a verdict of the host concerns.
    RoulettePlay = ROULETTE_PLAY, When::with(ROULETTE), Indirect(WavefrontCounters::DEFERRED_ARGS),
        "`deferred`, pending lists, `verdicts`"
        => "`rays`, `shadow_rays`, `paths`: weights, or the flag of an ended ray; `RouletteStats`";
}

impl Pass {
    /// The row of [`PASSES`].
    #[must_use]
    pub fn info(self) -> &'static PassInfo {
        // The table has a row per variant, in their order.
        &PASSES[self as usize]
    }

    /// The name of the pass.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.info().module.name
    }
}

/// The table of `shaders/README.md`.
#[must_use]
pub fn document() -> String {
    let names = |features: Features| features.iter_names().map(|(name, _)| format!("`{name}`")).collect::<Vec<_>>();
    let mut text = String::from("| Pass | When | Threads | Reads | Writes |\n|---|---|---|---|---|\n");
    for PassInfo { module, when, launch, reads, writes, .. } in &PASSES {
        let mut conditions = names(when.with);
        conditions.extend(names(when.without).iter().map(|name| format!("not {name}")));
        conditions.extend(when.image.map(|image| match image {
            PassImage::PixelCentres => "images through pixel centres".to_owned(),
            PassImage::Filtered => "filtered images".to_owned(),
            PassImage::RankedIds => "ranked ids".to_owned(),
            PassImage::Deep => "deep samples".to_owned(),
            PassImage::FirstHits => "images of first hits".to_owned(),
            PassImage::Spread => "`variance` or `error`".to_owned(),
            PassImage::SampleCount => "`sampleCount`".to_owned(),
            PassImage::ExactSums => "sums that merge".to_owned(),
        }));
        let threads = match launch {
            Direct(words) => (*words).to_owned(),
            Indirect(at) => {
                let known = INDIRECT.iter().find(|(_, offset)| offset == at).map_or("?", |(name, _)| name);
                format!("indirect `{known}`")
            }
        };
        let row = format!("| `{}` | {} | {threads} | {reads} | {writes} |\n", module.name, conditions.join(", "));
        text.push_str(&row.replace("|  |", "| always |"));
    }
    text
}

const INDIRECT: [(&str, u64); 10] = [
    ("TRACE_ARGS", WavefrontCounters::TRACE_ARGS),
    ("SHADOW_ARGS", WavefrontCounters::SHADOW_ARGS),
    ("SETTLE_CLOSEST_ARGS", WavefrontCounters::SETTLE_CLOSEST_ARGS),
    ("SETTLE_SHADOW_ARGS", WavefrontCounters::SETTLE_SHADOW_ARGS),
    ("RAY_ARGS", WavefrontCounters::RAY_ARGS),
    ("RESOLVE_ARGS", WavefrontCounters::RESOLVE_ARGS),
    ("SURFACE_ARGS", WavefrontCounters::SURFACE_ARGS),
    ("ESCAPED_ARGS", WavefrontCounters::ESCAPED_ARGS),
    ("DEFERRED_ARGS", WavefrontCounters::DEFERRED_ARGS),
    ("RETIRE_ARGS", WavefrontCounters::RETIRE_ARGS),
];
