// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_MOTION_READER_H
#define HDOOCPT_SCENE_MOTION_READER_H

#include "oocpt-bridge/src/lib.rs.h"
#include "pxr/base/gf/matrix4d.h"
#include "pxr/base/vt/value.h"
#include "pxr/imaging/hd/dataSource.h"
#include "pxr/imaging/hd/sceneIndex.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"
#include "scene/timeCodes.h"
#include "scene/warnings.h"

#include <array>
#include <utility>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

struct HdOocPTPrimSource;

/// When the shutter is open, in time codes from the current one. Nothing moves where it closes when it opens.
struct HdOocPTShutter
{
    double open = 0.0;
    double close = 0.0;
    HdOocPTTimeCodes timeCodes;

    bool IsOpen() const { return open < close; }
    /// The part of the shutter that a time is: 0 when it opens, 1 when it closes.
    double Part(double time) const { return (time - open) / (close - open); }
    /// When it opens and closes, in seconds from the current time code.
    std::array<double, 2> Seconds() const { return { open / timeCodes.perSecond, close / timeCodes.perSecond }; }

    bool operator==(const HdOocPTShutter& other) const
    {
        return open == other.open && close == other.close && timeCodes == other.timeCodes;
    }
    bool operator!=(const HdOocPTShutter& other) const { return !(*this == other); }
};

/// Transforms at parts of the shutter; empty where nothing moves.
using HdOocPTTransformSamples = std::vector<std::pair<double, GfMatrix4d>>;

/// How an instancer's instances move. The arrays share their data with the scene.
struct HdOocPTInstancerMotionState
{
    /// Part of the shutter; translations, rotations, scales, transforms.
    std::vector<std::pair<double, std::array<VtValue, 4>>> samples;
    VtValue velocities;
    VtValue accelerations;
    VtValue angularVelocities;
    /// When the shutter opens and closes, from the frame's own time.
    std::array<double, 2> seconds {};
};

/// How the points of a prim move. The arrays share their data with the scene.
struct HdOocPTPointsMotionState
{
    /// Part of the shutter; points, values of normals, values of widths.
    std::vector<std::pair<double, std::array<VtValue, 3>>> samples;
    VtValue velocities;
    VtValue accelerations;
    /// When the shutter opens and closes, from the frame's own time.
    std::array<double, 2> seconds {};
};

/// The shutter of a camera prim. Warns of one that closes before it opens.
HdOocPTShutter HdOocPTReadShutter(const HdSceneIndexBase& scene, const SdfPath& camera, HdOocPTWarnings* warnings);

/// The times at which some of the values have to be read; none if nothing changes while the shutter is open. Values may
/// be null.
std::vector<HdSampledDataSource::Time> HdOocPTReadSampleTimes(
    const std::vector<HdSampledDataSourceHandle>& sources, const HdOocPTShutter& shutter);

/// The transform of a prim about the shutter.
HdOocPTTransformSamples HdOocPTReadTransformSamples(
    const HdContainerDataSourceHandle& container, const HdOocPTShutter& shutter);

/// The samples as they go to Rust.
void HdOocPTFillMotion(const HdOocPTTransformSamples& samples, rust::Vec<double>* numbers);

/// How the instances of an instancer move.
HdOocPTInstancerMotionState HdOocPTReadInstancerMotion(const HdOocPTPrimSource& source);

/// How the points of a prim move. `hasWidths`: it is curves or points, whose widths and normals may change though the
/// points are at rest.
HdOocPTPointsMotionState HdOocPTReadPointsMotion(const HdOocPTPrimSource& source, bool hasWidths);

/// The state as it goes to Rust.
oocpt::MotionDesc HdOocPTDescribePointsMotion(const HdOocPTPointsMotionState& state);

/// The state as it goes to Rust.
oocpt::MotionDesc HdOocPTDescribeInstancerMotion(const HdOocPTInstancerMotionState& state);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
