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

/// The interval in which the shutter is open, in time codes from the current one. Nothing moves if it closes when it
/// opens.
struct HdOocPTShutter
{
    double open = 0.0;
    double close = 0.0;
    HdOocPTTimeCodes timeCodes;

    bool IsOpen() const { return open < close; }
    /// A time as a fraction of the shutter interval: 0 when it opens, 1 when it closes.
    double Part(double time) const { return (time - open) / (close - open); }
    /// The opening and closing times in seconds from the current time code.
    std::array<double, 2> Seconds() const { return { open / timeCodes.perSecond, close / timeCodes.perSecond }; }

    bool operator==(const HdOocPTShutter& other) const
    {
        return open == other.open && close == other.close && timeCodes == other.timeCodes;
    }
    bool operator!=(const HdOocPTShutter& other) const { return !(*this == other); }
};

/// Transforms at fractions of the shutter interval; empty if nothing moves.
using HdOocPTTransformSamples = std::vector<std::pair<double, GfMatrix4d>>;

/// The motion of an instancer's instances. The arrays share their data with the scene.
struct HdOocPTInstancerMotionState
{
    /// Fraction of the shutter interval; translations, rotations, scales, transforms.
    std::vector<std::pair<double, std::array<VtValue, 4>>> samples;
    VtValue velocities;
    VtValue accelerations;
    VtValue angularVelocities;
    /// The opening and closing times in seconds from the frame's own time.
    std::array<double, 2> seconds {};
};

/// The motion of a prim's points. The arrays share their data with the scene.
struct HdOocPTPointsMotionState
{
    /// Fraction of the shutter interval; points, values of normals, values of widths.
    std::vector<std::pair<double, std::array<VtValue, 3>>> samples;
    VtValue velocities;
    VtValue accelerations;
    /// The opening and closing times in seconds from the frame's own time.
    std::array<double, 2> seconds {};
};

/// The times at which the shutter of a camera prim opens and closes, in time codes from the current one, as they are
/// authored; 0 if there is no such camera.
std::array<double, 2> HdOocPTReadShutterTimes(const HdSceneIndexBase& scene, const SdfPath& camera);

/// The shutter of a camera prim. Warns of one that closes before it opens.
HdOocPTShutter HdOocPTReadShutter(const HdSceneIndexBase& scene, const SdfPath& camera, HdOocPTWarnings* warnings);

/// The times at which some of the values have to be read; empty if nothing changes while the shutter is open. Values
/// may be null.
std::vector<HdSampledDataSource::Time> HdOocPTReadSampleTimes(
    const std::vector<HdSampledDataSourceHandle>& sources, const HdOocPTShutter& shutter);

/// The transforms of a prim over the shutter interval.
HdOocPTTransformSamples HdOocPTReadTransformSamples(
    const HdContainerDataSourceHandle& container, const HdOocPTShutter& shutter);

/// Converts the samples for Rust.
void HdOocPTFillMotion(const HdOocPTTransformSamples& samples, rust::Vec<double>* numbers);

/// Reads the motion of an instancer's instances.
HdOocPTInstancerMotionState HdOocPTReadInstancerMotion(const HdOocPTPrimSource& source);

/// Reads the motion of a prim's points. `hasWidths`: it is curves or points, whose widths and normals may change though
/// the points are at rest.
HdOocPTPointsMotionState HdOocPTReadPointsMotion(const HdOocPTPrimSource& source, bool hasWidths);

/// Describes the motion of points for Rust.
oocpt::MotionDesc HdOocPTDescribePointsMotion(const HdOocPTPointsMotionState& state);

/// Describes the motion of instances for Rust.
oocpt::MotionDesc HdOocPTDescribeInstancerMotion(const HdOocPTInstancerMotionState& state);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
