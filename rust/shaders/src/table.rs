// SPDX-License-Identifier: Apache-2.0
//! The table of passes: everything that is declared about a wavefront pass, once.
//!
//! Compilation, recording, the inventory of a render, the table of `shaders/README.md` and the tests of the passes take
//! it from here. A pass has one name: its shader is `shaders/wavefront/NAME.comp`, and it shows under `NAME` in
//! timings, debuggers and errors. Pure, any thread.

use crate::{ShaderModule, modules::passes};
use oocpt_abi::{Features, WavefrontCounters};

/// When a frame has a pass.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PassCondition {
    /// All of these features,
    pub with: Features,
    /// none of these,
    pub without: Features,
    /// and this image is wanted.
    pub image: Option<PassImage>,
}

/// Images that need passes of their own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PassImage {
    /// Some plane that is traced through pixel centres.
    PixelCentres,
    /// `sampleCount`.
    SampleCount,
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

    /// Whether a frame with these features has the pass; `wants` tells which images it wants.
    pub fn holds(&self, features: Features, wants: impl Fn(PassImage) -> bool) -> bool {
        features.contains(self.with) && !features.intersects(self.without) && self.image.is_none_or(wants)
    }
}

/// How many threads a dispatch has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DispatchSize {
    /// As many as the host says; in words.
    Direct(&'static str),
    /// As many workgroups as the `IndirectArgs` at this offset of [`WavefrontCounters`] say.
    Indirect(u64),
}

/// A row of [`PASSES`].
#[derive(Debug, Clone, Copy)]
pub struct PassInfo {
    /// The pass.
    pub pass: Pass,
    /// Its shader.
    pub module: &'static ShaderModule,
    /// When a frame has it.
    pub when: PassCondition,
    /// How it is launched, where one way is all there is.
    pub launch: DispatchSize,
    /// What it reads of a frame, in words.
    pub reads: &'static str,
    /// What it writes, in words.
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
    /// The closest hit of each ray of a round.
    IntersectClosest = INTERSECT_CLOSEST, When::ALWAYS, Indirect(WavefrontCounters::TRACE_ARGS),
        "`ray_queue[r & 1]`, `rays`, scene; streaming: what waiting rays keep"
        => "`hits`; pushes to `surface_queue`, `escaped_queue` or `settle_queue[0]`; streaming: `progress`, pending \
            lists, flags of rays, pushes to `deferred`";
    /// Whether something is in the way of each shadow ray.
    IntersectShadow = INTERSECT_SHADOW, When::ALWAYS, Indirect(WavefrontCounters::SHADOW_ARGS),
        "`shadow_queue`, `shadow_rays`, scene; streaming: what waiting rays keep"
        => "adds to `radiance`; pushes to `settle_queue[1]`; streaming: as `intersect_closest`";
    /// The closest hit of the rays whose hit depends on a cutout's texture.
    SettleClosest = SETTLE_CLOSEST, When::with(Features::DEFERRED_CUTOUTS),
        Indirect(WavefrontCounters::SETTLE_CLOSEST_ARGS),
        "`settle_queue[0]`, `settle_hits[0]`, `hits`, `rays`, scene, textures"
        => "`hits`; pushes to `surface_queue` or `escaped_queue`; requests of tiles";
    /// Whether something is in the way of the shadow rays that met nothing but what depends on a cutout's texture.
    SettleShadow = SETTLE_SHADOW, When::with(Features::DEFERRED_CUTOUTS),
        Indirect(WavefrontCounters::SETTLE_SHADOW_ARGS),
        "`settle_queue[1]`, `settle_hits[1]`, `shadow_rays`, scene, textures"
        => "adds to `radiance`; requests of tiles";
    /// Keeps the surfaces that rays met in this round.
    RecordSurfaces = RECORD_SURFACES, When::with(STREAMING), Indirect(WavefrontCounters::RAY_ARGS),
        "`ray_queue[r & 1]`, `hits`, scene" => "`surfaces` of hits found in this round";
    /// Works out what surfaces are made of.
    ResolveMaterials = RESOLVE_MATERIALS, When::with(TEXTURES).without(Features::MESH_LIGHT_VALUES),
        Indirect(WavefrontCounters::RESOLVE_ARGS),
        "`resolve_queue`, `surfaces`, textures"
        => "`resolved`, `resolve_progress`; pushes to `surface_queue` or `deferred`";
    /// In place of `resolve_materials` where the emission of lights is a texture's or a primvar's.
    ResolveLights = RESOLVE_LIGHTS, When::with(TEXTURES.union(Features::MESH_LIGHT_VALUES)),
        Indirect(WavefrontCounters::RESOLVE_ARGS),
        "the same, and lights" => "the same; the last lookups are the emission of the light that will be asked";
    /// Adds what shines where rays leave the scene.
    ShadeBackground = SHADE_BACKGROUND, When::ALWAYS, Indirect(WavefrontCounters::ESCAPED_ARGS),
        "`escaped_queue`, `rays`, `paths`, lights" => "adds to `radiance`; streaming: `progress`, `segments`, `free_slots`";
    /// Shades the surfaces that rays met: light, the next ray, a shadow ray.
    ShadeSurface = SHADE_SURFACE, When::ALWAYS, Indirect(WavefrontCounters::SURFACE_ARGS),
        "`surface_queue`, `rays`, `paths`, lights, and `hits` and scene, or with streaming `surfaces`"
        => "`paths`, `rays`, `shadow_rays`; `radiance` at bounce 0; pushes to `shadow_queue`, \
            `ray_queue[(r + 1) & 1]`; streaming: as `shade_background`";
    /// Writes the planes that are traced through pixel centres.
    ShadeAovs = SHADE_AOVS, When::image(PassImage::PixelCentres), Direct("indirect `SURFACE_ARGS`, then `ESCAPED_ARGS`"),
        "the queue, and `hits` and scene, or with streaming `surfaces`" => "the planes of `FrameConstants::aov` that are not 0";
    /// Adds the samples of a wave or segment to the film.
    Accumulate = ACCUMULATE, When::ALWAYS, Direct("`min(path_count, width * height)`"),
        "`radiance`; streaming: `ended_radiance`" => "`film`";
    /// Writes the number of samples of each pixel.
    CountSamples = COUNT_SAMPLES, When::image(PassImage::SampleCount), Direct("`width * height`"),
        "`film`" => "its plane of `FrameConstants::aov`";
    /// Estimates the error of the picture.
    MeasureError = MEASURE_ERROR, When::ALWAYS, Direct("at most 1024 workgroups"),
        "`film`" => "`ErrorSums` of each workgroup, behind the film";
    /// Makes the picture of what the film holds.
    Resolve = RESOLVE, When::ALWAYS, Direct("`width * height`"), "`film`" => "`color`";
    /// Answers the questions of cutouts that rays left.
    ResolveCutouts = RESOLVE_CUTOUTS, When::with(TEXTURES.union(Features::CUTOUTS)),
        Indirect(WavefrontCounters::DEFERRED_ARGS),
        "`deferred`, textures" => "`questions`";
    /// Counts the waiting rays that may go on, by chunk.
    SortDeferredCount = SORT_DEFERRED_COUNT, When::with(STREAMING), Indirect(WavefrontCounters::DEFERRED_ARGS),
        "`deferred`, pending lists, chunks, meshes" => "adds to `sort_counts`";
    /// Sums those counts.
    SortDeferredScan = SORT_DEFERRED_SCAN, When::with(STREAMING), Direct("`sort_blocks` workgroups, then 1"),
        "`sort_counts`, `sort_sums`" => "the same; WavefrontCounters: room in the queues, the other list";
    /// Sends the waiting rays on that may go on, chunk by chunk.
    SortDeferredScatter = SORT_DEFERRED_SCATTER, When::with(STREAMING), Indirect(WavefrontCounters::DEFERRED_ARGS),
        "`deferred`, pending lists, chunks, meshes" => "`ray_queue`, `shadow_queue`, chunk by chunk; pushes to `deferred`";
    /// Counts waiting rays by unit.
    CountDemand = COUNT_DEMAND, When::with(STREAMING), Indirect(WavefrontCounters::DEFERRED_ARGS),
        "`deferred`, pending lists, chunks" => "adds to `demand`; pushes to `demanded`";
    /// Lists the units that rays wait for.
    ListDemand = LIST_DEMAND, When::with(STREAMING), Direct("at most 64 workgroups"),
        "`demanded`, `demand`" => "pushes to `demand_list`; `demand` = 0";
    /// Takes the radiance of ended paths out of their slots.
    RetirePaths = RETIRE_PATHS, When::with(STREAMING), Indirect(WavefrontCounters::RETIRE_ARGS),
        "`free_slots`, `places`, `radiance`" => "`ended_radiance`";
    /// Estimates the level of radiance of the picture.
    RouletteLevel = ROULETTE_LEVEL, When::with(ROULETTE), Direct("64, for the last paths"),
        "`segments`, `ended_radiance`" => "`RouletteStats`";
    /// Estimates what waiting rays may bring.
    RouletteWorth = ROULETTE_WORTH, When::with(ROULETTE), Indirect(WavefrontCounters::DEFERRED_ARGS),
        "`deferred`, pending lists, what the rays carry, `segments`, `ended_radiance`, `film`, `RouletteStats`"
        => "adds to `worth`, `worth_sums`";
    /// Weights or ends the rays that a verdict of the host concerns.
    RoulettePlay = ROULETTE_PLAY, When::with(ROULETTE), Indirect(WavefrontCounters::DEFERRED_ARGS),
        "`deferred`, pending lists, `verdicts`"
        => "`rays`, `shadow_rays`, `paths`: weights, or the flag of an ended ray; `RouletteStats`";
}

impl Pass {
    /// Its row of [`PASSES`].
    #[must_use]
    pub fn info(self) -> &'static PassInfo {
        // A row per variant, in their order.
        &PASSES[self as usize]
    }

    /// Its name.
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
            PassImage::SampleCount => "`sampleCount`".to_owned(),
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
