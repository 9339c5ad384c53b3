// SPDX-License-Identifier: Apache-2.0
//! Launch arithmetic: workgroup counts, wave numbering, hit strides.

use oocpt_abi::{
    FrameConstants, GpuChunkInstance, PushConstants, PushFlags, RAY_WORD_BOUNCE, RAY_WORD_FLAGS, RAY_WORD_IN_SHADOW,
    RAY_WORD_T_MAX, Ray, ShadowRay, WORKGROUP_SIZE, WavefrontCounters, groups, hit_stride, pack_band, pack_color,
    unpack_band, unpack_color,
};

#[test]
fn groups_cover_the_threads_and_stay_in_limits() {
    for threads in [0_u64, 1, 63, 64, 65, 1 << 21, (1 << 21) + 1, 12_345_678, 1 << 31] {
        let [x, y, z] = groups(threads);
        let covered = u64::from(x) * u64::from(y) * u64::from(z) * u64::from(WORKGROUP_SIZE);
        assert!(covered >= threads, "{threads} threads");
        assert!((1..=65_535).contains(&x) && (1..=65_535).contains(&y) && z == 1, "{threads} threads");
        assert!(covered <= 2 * threads.max(64), "{threads} threads: {covered} launched");
    }
}

#[test]
fn a_wave_starts_at_its_first_path() {
    let push = PushConstants::wave(16, 1_000_000_007, 4096, 1000);
    assert_eq!((push.first_sample, push.first_pixel, push.path_count), (1_000_000, 7, 4096));
    assert_eq!((push.with(3, 1).round, push.with(3, 1).arg0, push.with(3, 1).first_pixel), (3, 1, 7));
    assert_eq!(push.flagged(PushFlags::AOVS).with(0, 1).flags, 1, "a wave keeps its flags");
    assert_eq!(PushConstants::wave(16, 5, 1, 0).first_pixel, 0, "an empty image divides by nothing");
}

#[test]
fn struct_sizes_match_the_shaders() {
    assert_eq!([1, 3, 4, 7, 8].map(hit_stride), [32, 32, 48, 48, 64]);
    assert_eq!(size_of::<PushConstants>(), 32);
    assert_eq!([size_of::<Ray>(), size_of::<ShadowRay>(), size_of::<GpuChunkInstance>()], [48, 64, 80]);
    assert_eq!(size_of::<FrameConstants>() % 8, 0);
    assert_eq!(
        (WavefrontCounters::TOTALS_BYTES, WavefrontCounters::RAY_ARGS, WavefrontCounters::SHADOW_ARGS),
        (40, 96, 132)
    );
    assert_eq!(WavefrontCounters::TRACE_ARGS, 188);
}

#[test]
fn origins_are_split_without_loss() {
    let origin = [1.0e7 + 0.001, -3.0, 1.0e-3];
    let rows = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]];
    let instance = GpuChunkInstance::new(rows, origin, 3, 4, 5);
    for (i, row) in instance.chunk_from_world.iter().enumerate() {
        assert_eq!(row[..3], rows[i], "row {i}");
        let sum = f64::from(row[3]) + f64::from(instance.origin_lo[i]);
        assert!((sum - origin[i]).abs() <= origin[i].abs() * 2.0_f64.powi(-48), "component {i}: {sum}");
    }
    assert_eq!((instance.chunk, instance.instance_id), (3, 4));
}

#[test]
fn bands_and_rows_pack_into_one_word() {
    for (band, row) in [(0, 0), (0, (1 << 26) - 1), (1, 0), (63, 5), (63, (1 << 26) - 1)] {
        assert_eq!(unpack_band(pack_band(band, row)), (band, row), "{band}, {row}");
    }
    assert_eq!(pack_band(3, 7), 0x0c00_0007, "the bits that the passes read");
    let push = PushConstants::wave(1, 0, 64, 100).in_band(3, 7);
    assert_eq!(unpack_band(push.first_sample), (3, 7), "of a wave");
}

#[test]
fn a_colour_in_shadow_has_ten_bits_a_channel() {
    assert_eq!(pack_color([1.0, 0.0, 1.0]), 0x3ff0_03ff, "the bits that the passes read");
    assert_eq!(pack_color([2.0, -1.0, f32::NAN]), 0x3ff, "what is no share");
    for color in [[0.0; 3], [1.0; 3], [0.25, 0.5, 0.75]] {
        let back = unpack_color(pack_color(color));
        let off = color.iter().zip(back).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off <= 0.5 / 1023.0, "{color:?} comes back as {back:?}");
    }
}

#[test]
fn ray_words_are_at_the_offsets_traversal_reads() {
    assert_eq!([RAY_WORD_BOUNCE, RAY_WORD_T_MAX, RAY_WORD_FLAGS, RAY_WORD_IN_SHADOW], [3, 7, 11, 15], "the words");
}
