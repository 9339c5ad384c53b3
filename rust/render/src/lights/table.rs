// SPDX-License-Identifier: Apache-2.0
//! The light table: all lights of a scene.

use super::brightness::SceneBrightness;
use super::files::FileCache;
use super::picture::EncodedPicture;
use super::tree::{self, LightBounds};
use super::{EVEN_SHARE, MeshLights, count, local, luminance, narrow};
use crate::job::light_files::LightFiles;
use oocpt_abi::{
    Features, GpuInfiniteLight, GpuLightKey, GpuLightKind, GpuLightNode, GpuLightShaping, GpuLocalLight, LightFlags,
    LightTablePointers, NO_INDEX, PrimMask,
};
use oocpt_core::scene::{AssetRef, DomeFormat, DomeTexture, IesProfile, Light, LightEmitter, LocalLight, Snapshot};
use rustc_hash::FxHashMap;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// Share of the shadow rays that go to lights with a place if there are others too, and the contributions cannot be
/// compared.
const LOCAL_SHARE: f32 = 0.5;
/// Least share of the power that is attributed to local lights, and to meshes, if there are both.
const JOINT_SHARE: f64 = 0.05;

/// A picture with its placement.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PlacedPicture {
    pub(crate) picture: Arc<EncodedPicture>,
    /// Rows of dome-from-world.
    pub(crate) rows: [[f32; 3]; 3],
}

/// All lights of a scene in the layout of the device.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct LightTable {
    pub(crate) locals: Vec<GpuLocalLight>,
    pub(crate) nodes: Vec<GpuLightNode>,
    pub(crate) infinite: Vec<GpuInfiniteLight>,
    pub(crate) shapings: Vec<GpuLightShaping>,
    /// Profiles in words.
    pub(crate) profiles: Vec<u32>,
    pub(crate) maps: Vec<PlacedPicture>,
    pub(crate) link_bits: Vec<u32>,
    pub(crate) link_words: u32,
    /// Set of categories of each prim id + 1, then the prim id that is shown for each.
    pub(crate) prim_sets: Vec<u32>,
    /// Masks of prims by prim id + 1, four in a word, and their number.
    pub(crate) prim_masks: Vec<u32>,
    pub(crate) mask_count: u32,
    /// Keys of the lights that move.
    pub(crate) keys: Vec<GpuLightKey>,
    /// First key and number of keys of each local light; empty if none moves, as the next is.
    pub(crate) local_motion: Vec<[u32; 2]>,
    /// First key and number of keys of each light at infinity.
    pub(crate) infinite_motion: Vec<[u32; 2]>,
    /// The reach of the shadows of each local light; empty if none ends, as the next is.
    pub(crate) local_reaches: Vec<[f32; 4]>,
    /// The reach of the shadows of each light at infinity.
    pub(crate) infinite_reaches: Vec<[f32; 4]>,
    /// Whether some prim is in the way of shadow rays and not of other rays, or the other way round.
    pub(crate) parts_shadows: bool,
    /// Label of each local light in light path expressions.
    pub(crate) local_labels: Vec<Option<Arc<str>>>,
    /// Label of each light at infinity.
    pub(crate) infinite_labels: Vec<Option<Arc<str>>>,
    /// The features that the passes are compiled for.
    pub(crate) features: Features,
    /// Meshes that emit light.
    pub(crate) meshes: Option<Arc<MeshLights>>,
    /// The point that positions are relative to.
    origin: [f64; 3],
    /// Index of the node over local lights and meshes.
    joint: u32,
    bounds: Vec<LightBounds>,
    /// Power of all local lights.
    local_power: f64,
    /// The rough contributions of the groups, see [`SceneBrightness`].
    brightness: SceneBrightness,
    profile_words: FxHashMap<AssetRef, ProfilePlace>,
}

/// A profile in the table.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ProfilePlace {
    word: u32,
    /// Lumens.
    power: f64,
    /// The divisor of a normalised profile.
    mean: f64,
}

/// The inputs and results of reading files.
struct FileReader<'a> {
    files: &'a dyn LightFiles,
    cache: &'a mut FileCache,
    warnings: Vec<String>,
}

impl LightTable {
    /// Builds the table; returns it with warnings about files that could not be read.
    pub(crate) fn new(
        snapshot: &Snapshot,
        lights: &[Light],
        camera_visible: bool,
        files: &dyn LightFiles,
        cache: &mut FileCache,
    ) -> (Self, Vec<String>) {
        let mut table = Self { origin: snapshot.origin.to_array(), ..Self::default() };
        let mut reading = FileReader { files, cache, warnings: Vec::new() };
        let origin = snapshot.origin.to_array();
        let mut powers = Vec::new();
        for light in lights {
            let counts = [table.locals.len(), table.infinite.len()];
            match &light.emitter {
                LightEmitter::Local(local) => table.add_local(light, local, origin, &mut reading),
                LightEmitter::Distant { direction, one_minus_cos } => {
                    let solid_angle = TAU * f64::from(*one_minus_cos);
                    let irradiance = luminance(light.radiance) * if *one_minus_cos > 0.0 { solid_angle } else { 1.0 };
                    powers.push(irradiance);
                    table.brightness.add_distant(*direction, irradiance);
                    let still = light.motion.as_ref().map(|motion| motion.direction());
                    table.infinite.push(GpuInfiniteLight {
                        direction: still.unwrap_or(*direction),
                        one_minus_cos: *one_minus_cos,
                        ..local::infinite(light, GpuLightKind::Distant)
                    });
                }
                LightEmitter::Dome { texture } => {
                    let mean = table.add_dome(light, texture.as_ref(), camera_visible, &mut reading);
                    let irradiance = luminance(light.radiance) * PI * mean;
                    powers.push(irradiance);
                    table.brightness.domes += irradiance;
                }
            }
            table.add_motion(light, counts);
            table.add_reach(light, counts);
            table.local_labels.resize(table.locals.len(), light.label.clone());
            table.infinite_labels.resize(table.infinite.len(), light.label.clone());
        }
        if lights.iter().all(|light| light.shadow_reach.is_none()) {
            (table.local_reaches, table.infinite_reaches) = (Vec::new(), Vec::new());
        }
        if table.keys.is_empty() {
            (table.local_motion, table.infinite_motion) = (Vec::new(), Vec::new());
        }
        table.forget_large_links(&mut reading.warnings);
        table.choose(&powers);
        let total: f64 = table.bounds.iter().map(|b| b.power).sum();
        table.local_power = total;
        let (even, is_usable) = (1.0 / count(table.bounds.len()), total > 0.0 && total.is_finite());
        for bounds in &mut table.bounds {
            bounds.power = if is_usable { (1.0 - EVEN_SHARE) * bounds.power / total + EVEN_SHARE * even } else { even };
        }
        if !table.locals.is_empty() {
            table.nodes = tree::build(&table.bounds);
        }
        table.take_links(snapshot);
        table.take_masks(snapshot);
        table.features = table.find_features();
        reading.cache.forget_unused();
        reading.warnings.sort();
        reading.warnings.dedup();
        (table, reading.warnings)
    }

    /// Takes the sets of links, the set of each prim, and the id that is shown for it.
    fn take_links(&mut self, snapshot: &Snapshot) {
        if snapshot.links.is_empty() {
            return;
        }
        let surfaces = &snapshot.surfaces;
        self.link_bits = surfaces.category_sets.iter().flat_map(|set| snapshot.links.bits(set)).collect();
        if self.link_bits.is_empty() {
            self.link_bits = snapshot.links.bits(&[]);
        }
        self.link_words = u32::try_from(snapshot.links.words()).unwrap_or(u32::MAX);
        let shown = (-1..).zip(&surfaces.prims).map(|(id, prim)| prim.shown_as.unwrap_or(id).cast_unsigned());
        self.prim_sets = surfaces.prims.iter().map(|prim| prim.category_set).chain(shown).collect();
    }

    /// Takes what prims do without, which lights and rays read.
    fn take_masks(&mut self, snapshot: &Snapshot) {
        let masks = &snapshot.surfaces.masks;
        let word = |four: &[PrimMask]| {
            let bytes = (0..).step_by(8).zip(four).map(|(at, mask)| (mask.bits() & 0xff) << at);
            bytes.fold(0, |word, byte| word | byte)
        };
        self.prim_masks = masks.chunks(4).map(word).collect();
        self.mask_count = u32::try_from(masks.len()).unwrap_or_default();
        self.parts_shadows = masks.iter().any(|mask| mask.parts_shadows());
    }

    /// Adds the meshes that emit light, beside the local lights.
    pub(crate) fn add_meshes(&mut self, meshes: &Arc<MeshLights>) {
        if !self.locals.is_empty() {
            let locals = self.bounds.iter().fold(tree::NOTHING, |sum, bounds| sum.union(bounds));
            let (local, mesh) = (self.local_power, meshes.bounds.power);
            let is_usable = local + mesh > 0.0 && (local + mesh).is_finite();
            let share = if is_usable { local / (local + mesh) } else { 0.5 };
            let share = (if share.is_finite() { share } else { 0.5 }).clamp(JOINT_SHARE, 1.0 - JOINT_SHARE);
            // The tree has fewer nodes than 2^24.
            self.joint = u32::try_from(self.nodes.len()).unwrap_or_default();
            self.nodes.push(tree::joint(
                &LightBounds { power: share, ..locals },
                &LightBounds { power: 1.0 - share, ..meshes.bounds },
            ));
        }
        self.meshes = Some(Arc::clone(meshes));
        self.features = self.find_features();
    }

    /// Adds empty trees, and meshes of no power beside local lights, so that every light feature can be compiled in
    /// without changing sampling. Returns these features.
    pub(crate) fn carry(&mut self) -> Features {
        if self.nodes.is_empty() {
            self.nodes = tree::build(&[]);
        }
        if self.meshes.is_none() && !self.locals.is_empty() {
            let locals = self.bounds.iter().fold(tree::NOTHING, |sum, bounds| sum.union(bounds));
            self.joint = u32::try_from(self.nodes.len()).unwrap_or_default();
            self.nodes.push(tree::joint(&LightBounds { power: 1.0, ..locals }, &tree::NOTHING));
        }
        let places = Features::LOCAL_LIGHTS | Features::MESH_LIGHTS | Features::LIGHT_TEXTURE;
        let mut carried = places | Features::SHAPING | Features::IES | Features::DOME_TEXTURE;
        // With links the shares of several lights at infinity are summed anew, which rounds differently.
        carried.set(Features::LIGHT_LINKS, self.infinite.len() < 2);
        carried
    }

    fn find_features(&self) -> Features {
        let mut features = Features::empty();
        let kind = |kind: GpuLightKind| self.infinite.iter().any(|light| light.flags & 15 == kind as u32);
        features.set(Features::LOCAL_LIGHTS, !self.locals.is_empty());
        features.set(Features::DISTANT, kind(GpuLightKind::Distant));
        features.set(Features::DOME, kind(GpuLightKind::Dome) || kind(GpuLightKind::DomeMap));
        features.set(Features::DOME_SHADOW_RAYS, kind(GpuLightKind::Dome));
        features.set(
            Features::LIGHT_LOBES,
            self.infinite.iter().any(|light| light.diffuse.to_bits() != light.specular.to_bits())
                || self.locals.iter().any(|light| light.diffuse.to_bits() != light.specular.to_bits()),
        );
        features.set(Features::DOME_TEXTURE, kind(GpuLightKind::DomeMap));
        features.set(Features::SHAPING, !self.shapings.is_empty());
        features.set(Features::IES, !self.profiles.is_empty());
        features.set(Features::LIGHT_TEXTURE, self.locals.iter().any(|light| light.map != NO_INDEX));
        features.set(Features::LIGHT_LINKS, !self.link_bits.is_empty());
        features.set(Features::PRIM_MASKS, !self.prim_masks.is_empty());
        features.set(Features::MOVING_LIGHTS, !self.keys.is_empty());
        let ends = !self.local_reaches.is_empty() || !self.infinite_reaches.is_empty();
        features.set(Features::SHADOW_REACH, ends);
        features.set(Features::MESH_LIGHTS, self.meshes.is_some());
        let moves = self.meshes.as_ref().is_some_and(|meshes| !meshes.motion.is_empty());
        features.set(Features::MOVING_MESH_LIGHTS, moves);
        features.set(Features::MESH_LIGHT_VALUES, self.meshes.as_ref().is_some_and(|meshes| !meshes.values.is_empty()));
        let has_programs = self.meshes.as_ref().is_some_and(|meshes| !meshes.corners.is_empty());
        features.set(Features::MESH_LIGHT_PROGRAMS, has_programs);
        features
    }

    fn add_local(&mut self, light: &Light, local: &LocalLight, origin: [f64; 3], reading: &mut FileReader<'_>) {
        if self.locals.len() >= tree::MAX_LIGHTS {
            let (path, most) = (&light.path, tree::MAX_LIGHTS);
            reading.warnings.push(format!("{path}: limits of the renderer: of more than {most} lights it is left out"));
            return;
        }
        let Some(mut gpu) = local::encode(light, local, origin) else {
            reading.warnings.push(format!("{}: the light is too small or too large, and is left out", light.path));
            return;
        };
        let mut brightness = 1.0;
        if let Some(asset) = &local.texture {
            match reading.cache.picture(asset, None, reading.files) {
                Ok(picture) => {
                    brightness *= picture.mean.max(1e-3);
                    gpu.map = self.map(picture, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
                }
                Err(error) => reading
                    .warnings
                    .push(format!("{}: the texture {} is left out: {error}", light.path, asset.authored)),
            }
        }
        if let Some(shaping) = &local.shaping {
            let mut ies = None;
            if let Some(asset) = &shaping.ies {
                match self.profile(asset, reading) {
                    Ok(ProfilePlace { word, power, mean }) => {
                        let scale = if shaping.ies_normalize && mean > 0.0 { 1.0 / mean } else { 1.0 };
                        brightness *= (power * scale / (4.0 * PI)).max(1e-6);
                        ies = Some((word, narrow(scale)));
                    }
                    Err(error) => reading
                        .warnings
                        .push(format!("{}: the profile {} is left out: {error}", light.path, asset.authored)),
                }
            }
            // Shapings are fewer than lights.
            gpu.shaping = u32::try_from(self.shapings.len()).unwrap_or(NO_INDEX);
            let frame = light.motion.as_ref().map_or(local.frame, |motion| motion.frame);
            let axes = [frame.x_axis, frame.y_axis, frame.z_axis].map(|axis| axis.to_array());
            self.shapings.push(local::shaping(axes, shaping, ies));
        }
        let bounds = local::bounds(light, local, origin, brightness);
        self.brightness.local += bounds.power * local::concentration(local);
        self.bounds.push(bounds);
        self.locals.push(gpu);
    }

    /// Adds the motion of a light, if the table has taken it: it had `counts` local lights and lights at infinity
    /// before.
    fn add_motion(&mut self, light: &Light, counts: [usize; 2]) {
        let motion = light.motion.as_deref();
        let mut place = [0; 2];
        if let Some(motion) = motion.filter(|_| counts != [self.locals.len(), self.infinite.len()]) {
            // There are at most 16 for each of 2^23 lights.
            let number = |n: usize| u32::try_from(n).unwrap_or_default();
            place = [number(self.keys.len()), number(motion.keys.len())];
            let is_local = matches!(light.emitter, LightEmitter::Local(_));
            let origin = if is_local { self.origin } else { [0.0; 3] };
            self.keys.extend(local::keys(motion, origin));
        }
        if self.locals.len() > counts[0] {
            self.local_motion.push(place);
        }
        if self.infinite.len() > counts[1] {
            self.infinite_motion.push(place);
        }
    }

    /// Adds the reach of the shadows of a light, if the table has taken it, as [`Self::add_motion`] does.
    fn add_reach(&mut self, light: &Light, counts: [usize; 2]) {
        if self.locals.len() > counts[0] {
            self.local_reaches.push(local::reach(light));
        }
        if self.infinite.len() > counts[1] {
            self.infinite_reaches.push(local::reach(light));
        }
    }

    /// Adds a dome and returns the mean luminance of its picture, 1 without one.
    fn add_dome(
        &mut self,
        light: &Light,
        texture: Option<&DomeTexture>,
        camera_visible: bool,
        reading: &mut FileReader<'_>,
    ) -> f64 {
        let mut gpu = local::infinite(light, GpuLightKind::Dome);
        let mut mean = 1.0;
        if let Some(texture) = texture {
            if texture.format == DomeFormat::Other {
                reading
                    .warnings
                    .push(format!("{}: the dome's texture:format is not known, and is read as latlong", light.path));
            }
            match reading.cache.picture(&texture.asset, Some(texture.format), reading.files) {
                Ok(picture) => {
                    mean = picture.mean;
                    gpu = local::infinite(light, GpuLightKind::DomeMap);
                    let turned = light.motion.as_ref().map(|motion| motion.rows());
                    gpu.map = self.map(picture, turned.unwrap_or(texture.dome_from_world));
                }
                Err(error) => {
                    let file = &texture.asset.authored;
                    reading.warnings.push(format!(
                        "{}: the texture {file} is left out, the dome has its constant colour: {error}",
                        light.path
                    ));
                }
            }
        }
        if !camera_visible {
            gpu.flags &= !LightFlags::CAMERA_VISIBLE.bits();
        }
        self.infinite.push(gpu);
        mean
    }

    fn map(&mut self, picture: Arc<EncodedPicture>, rows: [[f32; 3]; 3]) -> u32 {
        let map = PlacedPicture { picture, rows };
        let known = self.maps.iter().position(|m| Arc::ptr_eq(&m.picture, &map.picture) && m.rows == map.rows);
        let at = known.unwrap_or_else(|| {
            self.maps.push(map);
            self.maps.len() - 1
        });
        u32::try_from(at).unwrap_or(NO_INDEX)
    }

    fn profile(&mut self, asset: &AssetRef, reading: &mut FileReader<'_>) -> Result<ProfilePlace, String> {
        if let Some(&known) = self.profile_words.get(asset) {
            return Ok(known);
        }
        let profile: Arc<IesProfile> = reading.cache.profile(asset, reading.files)?;
        let word = u32::try_from(self.profiles.len()).map_err(|error| error.to_string())?;
        let length = |list: &[f32]| u32::try_from(list.len()).unwrap_or_default();
        self.profiles.extend([length(&profile.vertical), length(&profile.horizontal)]);
        for list in [&profile.vertical, &profile.horizontal, &profile.candela] {
            self.profiles.extend(list.iter().map(|v| v.to_bits()));
        }
        let place = ProfilePlace { word, power: profile.power, mean: profile.mean() };
        self.profile_words.insert(asset.clone(), place);
        Ok(place)
    }

    /// Drops links that do not fit: a shadow ray has 16 bits for its category.
    fn forget_large_links(&mut self, warnings: &mut Vec<String>) {
        let local = self.locals.iter_mut().map(|light| (&mut light.shadow_link, &mut light.flags));
        let infinite = self.infinite.iter_mut().map(|light| (&mut light.shadow_link, &mut light.flags));
        for (link, flags) in local.chain(infinite).filter(|(link, _)| **link > 0xffff) {
            *link = 0;
            *flags &= !LightFlags::SHADOW_LINK.bits();
            warnings.push(
                "lights: more than 65535 collections of light linking: the shadow links of the last are left out"
                    .into(),
            );
        }
    }

    /// Sets the probabilities of the lights at infinity from their possible irradiance.
    fn choose(&mut self, powers: &[f64]) {
        let total: f64 = powers.iter().sum();
        let even = 1.0 / count(powers.len());
        let mut cumulative = 0.0;
        for (light, power) in self.infinite.iter_mut().zip(powers) {
            let is_usable = total > 0.0 && total.is_finite();
            let share = if is_usable { 0.9 * power / total + 0.1 * even } else { even };
            cumulative += share;
            light.probability = narrow(share);
            light.cumulative = narrow(cumulative);
        }
        if let Some(last) = self.infinite.last_mut() {
            last.cumulative = 1.0;
        }
    }

    /// Returns true if the camera sees a dome.
    pub(crate) fn background_visible(&self) -> bool {
        let is_dome = |light: &GpuInfiniteLight| light.flags & 15 != GpuLightKind::Distant as u32;
        self.infinite.iter().any(|light| is_dome(light) && light.flags & LightFlags::CAMERA_VISIBLE.bits() != 0)
    }

    /// Most textures that are looked up for the emission of a sampled point.
    pub(crate) fn mesh_lookups(&self) -> u32 {
        self.meshes.as_ref().map_or(0, |meshes| meshes.lookups)
    }

    /// The block without addresses.
    pub(crate) fn block(&self) -> LightTablePointers {
        let without_place = self.locals.is_empty() && self.meshes.is_none();
        let local_share = match (without_place, self.infinite.is_empty()) {
            (true, _) => 0.0,
            (false, true) => 1.0,
            (false, false) => LOCAL_SHARE,
        };
        let infinite_count = u32::try_from(self.infinite.len()).unwrap_or(u32::MAX);
        let prim_count = u32::try_from(self.prim_sets.len() / 2).unwrap_or(u32::MAX);
        let mesh_light_count =
            self.meshes.as_ref().map_or(0, |meshes| u32::try_from(meshes.placements.len()).unwrap_or(u32::MAX));
        let block = LightTablePointers {
            infinite_count,
            link_words: self.link_words,
            local_share,
            prim_count,
            mesh_light_count,
            joint: self.joint,
            textured_mesh_lights: u32::from(self.mesh_lookups() > 0),
            ..LightTablePointers::default()
        };
        let mesh_power = self.meshes.as_ref().map(|meshes| meshes.bounds.power);
        self.brightness.put(block, !self.locals.is_empty(), mesh_power)
    }
}
