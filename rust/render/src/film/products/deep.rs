// SPDX-License-Identifier: Apache-2.0
//! Deep images: what each pixel shows, by depth. Each sample of a pixel meets one thing first, so the samples of a
//! pixel are alternatives, with shares that add up to alpha. A deep image has layers in place of that, each over those
//! behind it ("Interpreting `OpenEXR` Deep Pixels", Kainz 2013): what is in front of a layer lets 1 - (its shares) of
//! it through, so the layer's alpha and colour are divided by that, and flattening the pixel gives the picture. All
//! layers are surfaces: they have no depth of their own.

use super::cryptomatte::{self, NamedThings};
use super::deep_lines::{self, DeepLine};
use crate::film::picture::exr_text;
use crate::job::deep::DeepLimits;
use crate::job::product::{DeepPart, FileChannel, ProductFile, SampleFormat};
use bytemuck::pod_collect_to_vec;
use exr::compression::Compression;
use exr::meta::attribute::{ChannelDescription, ChannelList, LineOrder, SampleType};
use exr::meta::{BlockDescription, header::Header};
use exr::prelude::{ImageAttributes, LayerAttributes, Vec2, f16};
use oocpt_abi::DeepSlot;
use oocpt_core::scene::PrimNames;
use rustc_hash::FxHashSet;
use std::collections::BTreeMap;
use std::fs::File;

/// What is left of a pixel behind layers that hide all but this is nothing: rounding of their shares. The share of a
/// sample is larger.
const NOTHING_LEFT: f64 = 1e-6;

/// A deep image that is to be written.
#[derive(Debug)]
pub(super) struct DeepImage<'a> {
    file: &'a ProductFile,
    compression: Compression,
    /// In the order of their names, as they are in a file.
    channels: Vec<&'a FileChannel>,
    /// Of the file, and of the image, which may have more.
    limits: [DeepLimits; 2],
    /// Top row first.
    rows: Vec<&'a [u8]>,
    /// Names by layer.
    named: BTreeMap<&'a str, NamedThings>,
}

impl<'a> DeepImage<'a> {
    /// The image of `file`, of the rows of a deep image of these limits, top row first; `None` if it asks for names and
    /// there are none.
    pub(super) fn new(
        (file, compression): (&'a ProductFile, Compression),
        limits: DeepLimits,
        rows: Vec<&'a [u8]>,
        names: Option<&PrimNames>,
    ) -> Option<Self> {
        let mut channels: Vec<&FileChannel> = file.channels.iter().collect();
        channels.sort_by(|a, b| a.name.cmp(&b.name));
        let mut named = BTreeMap::new();
        for layer in channels.iter().filter_map(|channel| channel.cryptomatte.as_ref()) {
            let slots = rows.iter().flat_map(|row| row.chunks_exact(size_of::<DeepSlot>()));
            let slots = slots.map(bytemuck::pod_read_unaligned::<DeepSlot>);
            let seen: FxHashSet<_> = slots.filter(|slot| slot.id != 0).map(|slot| (slot.id, slot.instance)).collect();
            named.insert(&*layer.name, cryptomatte::named(layer, names?, seen));
        }
        Some(Self { file, compression, channels, limits: [file.deep.unwrap_or(limits), limits], rows, named })
    }

    /// What a user should know of the file.
    pub(super) fn warning(&self) -> Option<String> {
        let unnamed: usize = self.named.values().map(|named| named.unnamed).sum();
        (unnamed > 0).then(|| format!("{unnamed} names are not in the manifest"))
    }

    /// Names and values of attributes of its layers of names.
    pub(super) fn manifests(&self) -> Vec<(String, String)> {
        self.named.values().flat_map(|named| named.attributes.iter().cloned()).collect()
    }

    /// Writes the file.
    pub(super) fn write(&self, out: File, layer: LayerAttributes, shared: ImageAttributes) -> std::io::Result<()> {
        let pixel_bytes = usize::from(self.limits[1].samples()) * size_of::<DeepSlot>();
        let width = self.rows.first().map_or(0, |row| row.len() / pixel_bytes);
        let channels = self.channels.iter().map(|channel| ChannelDescription {
            name: exr_text(channel.name.as_str()),
            sample_type: match channel.format {
                SampleFormat::Half => SampleType::F16,
                SampleFormat::Float => SampleType::F32,
                SampleFormat::Uint => SampleType::U32,
            },
            quantize_linearly: false,
            sampling: Vec2(1, 1),
        });
        let header = Header {
            channels: ChannelList::new(channels.collect()),
            compression: self.compression,
            blocks: BlockDescription::ScanLines,
            line_order: LineOrder::Increasing,
            layer_size: Vec2(width, self.rows.len()),
            chunk_count: self.rows.len(),
            deep: true,
            deep_data_version: Some(1),
            max_samples_per_pixel: Some(0),
            shared_attributes: shared,
            own_attributes: layer,
        };
        deep_lines::write(out, header, pixel_bytes * width, |y| self.line(self.rows.get(y).copied().unwrap_or(&[])))
    }

    /// The line of a row of the image.
    fn line(&self, row: &[u8]) -> DeepLine {
        let pixel_bytes = usize::from(self.limits[1].samples()) * size_of::<DeepSlot>();
        let pixels = row.chunks_exact(pixel_bytes).map(|pixel| {
            let slots = pod_collect_to_vec::<u8, DeepSlot>(pixel);
            let taken = slots.iter().position(|slot| slot.weight <= 0.0).unwrap_or(slots.len());
            let [of_file, of_image] = self.limits;
            let slots = if of_file == of_image { slots[..taken].to_vec() } else { fewer(&slots[..taken], of_file) };
            layers(slots)
        });
        let pixels: Vec<Vec<DeepSlot>> = pixels.collect();
        let mut line = DeepLine { counts: pixels.iter().map(Vec::len).collect(), data: Vec::new() };
        for channel in &self.channels {
            for slot in pixels.iter().flatten() {
                self.put(channel, slot, &mut line.data);
            }
        }
        line
    }

    /// Appends the number that a channel has of a sample.
    fn put(&self, channel: &FileChannel, slot: &DeepSlot, data: &mut Vec<u8>) {
        let number = match DeepPart::of(channel) {
            DeepPart::Prim => return data.extend(slot.id.wrapping_sub(1).to_le_bytes()),
            DeepPart::Instance => {
                let instance = if slot.id == 0 { u32::MAX } else { slot.instance };
                return data.extend(instance.to_le_bytes());
            }
            DeepPart::Name => {
                let named = channel.cryptomatte.as_ref().and_then(|layer| self.named.get(&*layer.name));
                let hash = named.and_then(|named| named.ids.get(&(slot.id, slot.instance)));
                return data.extend(hash.copied().unwrap_or(0).to_le_bytes());
            }
            DeepPart::Red => self.color(slot, 0),
            DeepPart::Green => self.color(slot, 1),
            DeepPart::Blue => self.color(slot, 2),
            DeepPart::Alpha => slot.alpha,
            DeepPart::Depth => slot.depth,
        };
        match channel.format {
            SampleFormat::Half => data.extend(f16::from_f32(number).to_le_bytes()),
            SampleFormat::Float | SampleFormat::Uint => data.extend(number.to_le_bytes()),
        }
    }

    /// A component of a sample's colour in the space of the file.
    fn color(&self, slot: &DeepSlot, component: usize) -> f32 {
        let [r, g, b] = slot.color;
        let weights = self.file.space.and_then(|space| space.from_rec709().get(component).copied());
        #[expect(clippy::cast_possible_truncation, reason = "sums are rounded to floats")]
        let of_space = |w: [f64; 3]| (w[0] * f64::from(r) + w[1] * f64::from(g) + w[2] * f64::from(b)) as f32;
        weights.map_or(slot.color[component.min(2)], of_space)
    }
}

/// Whether slots of these limits are one: `is_one_thing` and `is_one_depth` of `shaders/wavefront/deep.glsl`.
fn is_one(a: &DeepSlot, b: &DeepSlot, limits: DeepLimits) -> bool {
    let [part, distance] = limits.depths();
    let apart = (a.depth - b.depth).abs();
    (a.id, a.instance) == (b.id, b.instance) && apart <= distance.max(part * a.depth.abs().min(b.depth.abs()))
}

/// Both slots as one, which is of the thing with the larger share.
fn together(a: &DeepSlot, b: &DeepSlot) -> DeepSlot {
    let (weight, is_far) = (a.weight + b.weight, a.depth.max(b.depth) >= oocpt_abi::DEEP_FAR);
    let of_thing = if b.weight > a.weight { b } else { a };
    DeepSlot {
        weight,
        depth: if is_far { a.depth.min(b.depth) } else { a.depth + (b.depth - a.depth) * (b.weight / weight) },
        color: std::array::from_fn(|at| a.color[at] + b.color[at]),
        alpha: a.alpha + b.alpha,
        ..*of_thing
    }
}

/// The slots of a pixel within other limits, nearest first.
fn fewer(slots: &[DeepSlot], limits: DeepLimits) -> Vec<DeepSlot> {
    let mut all = slots.to_vec();
    sort(&mut all);
    let mut kept: Vec<DeepSlot> = Vec::with_capacity(all.len());
    for slot in all {
        match kept.iter_mut().find(|have| is_one(have, &slot, limits)) {
            Some(have) => *have = together(have, &slot),
            None => kept.push(slot),
        }
    }
    sort(&mut kept);
    while kept.len() > usize::from(limits.samples()) {
        // Two of one thing if there are any, the nearest ones of these.
        let pairs = (0..kept.len()).flat_map(|j| (0..j).map(move |i| (i, j)));
        let apart = |(i, j): (usize, usize)| {
            let (a, b): (&DeepSlot, &DeepSlot) = (&kept[i], &kept[j]);
            ((a.id, a.instance) != (b.id, b.instance), b.depth - a.depth)
        };
        let nearest = pairs.min_by(|a, b| {
            let (a, b) = (apart(*a), apart(*b));
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
        });
        let Some((i, j)) = nearest else { break };
        kept[i] = together(&kept[i], &kept[j]);
        kept.remove(j);
    }
    kept
}

fn sort(slots: &mut [DeepSlot]) {
    slots.sort_by(|a, b| a.depth.total_cmp(&b.depth).then((a.id, a.instance).cmp(&(b.id, b.instance))));
}

/// The layers of a pixel, nearest first: alpha and colour are those over what is behind.
#[expect(clippy::cast_possible_truncation, reason = "numbers of a file are floats")]
fn layers(mut slots: Vec<DeepSlot>) -> Vec<DeepSlot> {
    sort(&mut slots);
    let mut layers: Vec<DeepSlot> = Vec::with_capacity(slots.len());
    let (mut left, mut last_left) = (1.0_f64, 1.0_f64);
    for slot in slots {
        let share = f64::from(slot.alpha);
        if left < NOTHING_LEFT {
            // Light without alpha behind what hides all: it was seen, so it stays.
            if let Some(last) = layers.last_mut() {
                for (to, add) in last.color.iter_mut().zip(slot.color) {
                    *to = (f64::from(*to) + f64::from(add) / last_left) as f32;
                }
            }
            continue;
        }
        let over = |part: f32| (f64::from(part) / left) as f32;
        layers.push(DeepSlot { color: slot.color.map(over), alpha: over(slot.alpha).clamp(0.0, 1.0), ..slot });
        last_left = left;
        left -= share;
    }
    layers
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slot(id: u32, depth: f32, share: f32) -> DeepSlot {
        DeepSlot { id, instance: 0, weight: share, depth, color: [share, 2.0 * share, 0.0], alpha: share }
    }

    /// Alpha and green of layers over each other.
    fn flattened(layers: &[DeepSlot]) -> [f64; 2] {
        let mut left = 1.0;
        layers.iter().fold([0.0; 2], |[alpha, green], layer| {
            let seen = [alpha + left * f64::from(layer.alpha), green + left * f64::from(layer.color[1])];
            left *= 1.0 - f64::from(layer.alpha);
            seen
        })
    }

    #[test]
    fn layers_over_each_other_have_the_shares_of_their_slots() {
        let third = 1.0 / 3.0;
        for shares in [[0.5, 0.25, 0.25], [third, third, third], [0.125, 0.0, 0.5], [1.0, 0.0, 0.0]] {
            let [a, b, c] = shares;
            let layers = layers(vec![slot(3, 9.0, c), slot(1, 2.0, a), slot(2, 4.0, b)]);
            assert!(layers.windows(2).all(|pair| pair[0].depth <= pair[1].depth), "nearest first");
            assert!(layers.iter().all(|layer| (0.0..=1.0).contains(&layer.alpha)), "{layers:?}");
            let [alpha, green] = flattened(&layers);
            let sum = f64::from(a + b + c);
            assert!((alpha - sum).abs() < 1e-6 && (green - 2.0 * sum).abs() < 2e-6, "{shares:?}: {alpha} {green}");
        }
        let [front, back] = layers(vec![slot(1, 1.0, 0.5), slot(2, 2.0, 0.5)])[..] else { panic!("two layers") };
        assert_eq!([front.alpha, back.alpha], [0.5, 1.0], "what is behind is all of what is left");
    }

    #[test]
    fn light_behind_what_hides_all_is_not_lost() {
        let glow = DeepSlot { alpha: 0.0, ..slot(2, 5.0, 0.25) };
        let layers = layers(vec![slot(1, 1.0, 1.0), glow]);
        assert_eq!(layers.len(), 1);
        assert!((flattened(&layers)[1] - 2.5).abs() < 1e-6, "{layers:?}");
    }

    #[test]
    fn other_limits_join_the_nearest_of_one_thing_first() {
        let limits = |samples, part| {
            let usual = DeepLimits::default().with_samples(samples);
            usual.and_then(|limits| limits.with_depths(part, 0.0)).expect("limits")
        };
        let all = [slot(1, 1.0, 0.25), slot(2, 1.01, 0.25), slot(1, 2.0, 0.125), slot(1, 2.1, 0.125)];
        let [two, three] = [limits(2, 0.0), limits(3, 0.0)].map(|limits| fewer(&all, limits));
        assert_eq!(three.iter().map(|slot| slot.id).collect::<Vec<_>>(), [1, 2, 1]);
        assert!((three[2].depth - 2.05).abs() < 1e-6 && (three[2].weight - 0.25).abs() < 1e-6, "{three:?}");
        assert_eq!(two.len(), 2, "{two:?}");
        assert_eq!(fewer(&all, limits(1, 0.0)).len(), 1);
        assert_eq!(fewer(&all, limits(16, 0.05)).len(), 3, "depths that are near");
        for kept in [&two, &three] {
            assert!((kept.iter().map(|slot| slot.alpha).sum::<f32>() - 0.75).abs() < 1e-6, "all of it");
        }
        let sky = DeepSlot { depth: oocpt_abi::DEEP_FAR, ..slot(0, 0.0, 0.25) };
        let [joined] = fewer(&[slot(1, 3.0, 0.25), sky], limits(1, 0.0))[..] else { panic!("one slot") };
        assert!((joined.depth - 3.0).abs() < 1e-6, "the sky has no depth");
    }
}
