// SPDX-License-Identifier: Apache-2.0
//! What moves while the shutter is open, as it crosses the boundary. Pure; any thread.

use crate::convert::ConversionWarnings;
use crate::ffi;
use oocpt_core::array::column_matrix;
use oocpt_core::scene::{InstancerMotion, InstancerSample, PointsMotion, PointsSample, TransformSample};

/// Numbers of a sample: its time and a matrix.
const SAMPLE: usize = 17;

/// Transforms at times.
pub(crate) fn transform_samples(numbers: &[f64]) -> Vec<TransformSample> {
    let sample = |numbers: &[f64]| {
        let (time, matrix) = numbers.split_first()?;
        Some(TransformSample { time: *time, transform: column_matrix(matrix.first_chunk()?) })
    };
    numbers.chunks_exact(SAMPLE).filter_map(sample).collect()
}

/// How points move.
pub(crate) fn points_motion(desc: ffi::MotionDesc, path: &str, complaints: &mut ConversionWarnings) -> PointsMotion {
    let sample = |sample: ffi::MotionSampleDesc| PointsSample {
        time: sample.time,
        points: complaints.required::<[f32; 3]>(path, "points", sample.positions),
        normals: complaints.optional(path, "normals", sample.normals),
        widths: complaints.optional(path, "widths", sample.widths),
    };
    PointsMotion {
        samples: desc.samples.into_iter().map(sample).collect(),
        velocities: complaints.optional(path, "velocities", desc.velocities),
        accelerations: complaints.optional(path, "accelerations", desc.accelerations),
        seconds: desc.seconds,
    }
}

/// How instances move. Samples that cannot be read are left out with all others.
pub(crate) fn instancer_motion(
    desc: ffi::MotionDesc,
    path: &str,
    complaints: &mut ConversionWarnings,
) -> InstancerMotion {
    let samples = desc.samples.into_iter().map(|sample| InstancerSample {
        time: sample.time,
        translations: complaints.optional(path, "instanceTranslations", sample.positions),
        rotations: complaints.optional(path, "instanceRotations", sample.rotations),
        scales: complaints.optional(path, "instanceScales", sample.scales),
        transforms: complaints.optional(path, "instanceTransforms", sample.transforms),
    });
    InstancerMotion {
        samples: samples.collect(),
        velocities: complaints.optional(path, "velocities", desc.velocities),
        accelerations: complaints.optional(path, "accelerations", desc.accelerations),
        angular_velocities: complaints.optional(path, "angularVelocities", desc.angular_velocities),
        seconds: desc.seconds,
    }
}
