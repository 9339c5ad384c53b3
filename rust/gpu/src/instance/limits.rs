// SPDX-License-Identifier: Apache-2.0
//! Limits of the open device that callers must keep.

use crate::instance::probe::ProbedDevice;

/// Limits of the open device that callers plan with.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct DeviceLimits {
    /// Largest buffer, arena or dedicated range in bytes.
    pub max_allocation_bytes: u64,
    /// Largest number of workgroups of a dispatch in each dimension.
    pub max_workgroups: [u32; 3],
    /// Largest number of threads of a workgroup.
    pub max_workgroup_threads: u32,
    /// Largest size of push constants, bytes.
    pub max_push_bytes: u32,
    /// Bytes of shared memory of a workgroup.
    pub max_shared_bytes: u32,
    /// Number of invocations that run in lockstep.
    pub subgroup_size: u32,
    /// Duration of a timestamp tick, nanoseconds.
    pub timestamp_period_ns: f32,
}

impl DeviceLimits {
    pub(crate) fn of(probed: &ProbedDevice) -> Self {
        let limits = &probed.properties.limits;
        Self {
            max_allocation_bytes: probed.max_allocation_bytes,
            max_workgroups: limits.max_compute_work_group_count,
            max_workgroup_threads: limits.max_compute_work_group_invocations.min(limits.max_compute_work_group_size[0]),
            max_push_bytes: limits.max_push_constants_size,
            max_shared_bytes: limits.max_compute_shared_memory_size,
            subgroup_size: probed.subgroup_size,
            timestamp_period_ns: limits.timestamp_period,
        }
    }
}
