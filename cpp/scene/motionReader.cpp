// SPDX-License-Identifier: Apache-2.0
#include "scene/motionReader.h"

#include "bridge/vtArray.h"
#include "scene/dataSource.h"
#include "scene/primReader.h"
#include "scene/tokens.h"

#include <algorithm>
#include <cmath>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

using _Times = std::vector<HdSampledDataSource::Time>;

/// Most samples that are read: the core keeps a quarter of them, and each may be an array of millions.
constexpr size_t _mostSamples = 64;

/// Drops samples between the first and the last if there are too many, evenly.
void _ThinOut(_Times* times)
{
    const size_t count = times->size();
    if (count <= _mostSamples) {
        return;
    }
    _Times kept(_mostSamples);
    for (size_t i = 0; i < _mostSamples; ++i) {
        kept[i] = (*times)[i * (count - 1) / (_mostSamples - 1)];
    }
    times->swap(kept);
}

/// The times at which a value has to be read; empty if it does not change while the shutter is open.
_Times _SampleTimes(const HdDataSourceBaseHandle& source, const HdOocPTShutter& shutter)
{
    _Times times;
    const HdSampledDataSourceHandle sampled = HdSampledDataSource::Cast(source);
    const bool varies = sampled && shutter.IsOpen()
        && sampled->GetContributingSampleTimesForInterval(
            static_cast<float>(shutter.open), static_cast<float>(shutter.close), &times);
    if (!varies || times.size() < 2) {
        times.clear();
    }
    _ThinOut(&times);
    return times;
}

/// Adds the times of another value. The times of a single value stay as they are, so that a wrong order of them is
/// reported.
void _AddTimes(const _Times& own, _Times* times)
{
    if (times->empty()) {
        *times = own;
    } else if (!own.empty() && own != *times) {
        times->insert(times->end(), own.begin(), own.end());
        std::sort(times->begin(), times->end());
        times->erase(std::unique(times->begin(), times->end()), times->end());
        _ThinOut(times);
    }
}

/// An array of changes per second; empty if there is none. Warns if the length of a second is a guess.
VtValue _ReadRates(const HdOocPTPrimSource& source, const TfToken& name)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const VtValue array
        = HdOocPTReadArray(source, { tokens.primvars, name, tokens.primvarValue }, HdOocPTArrayRole::Vectors3);
    if (array.GetArraySize() == 0) {
        return VtValue();
    }
    const HdOocPTTimeCodes& timeCodes = source.shutter.timeCodes;
    if (!timeCodes.doubt.empty()) {
        source.warnings->Add(source.path,
            "velocities and accelerations are per second, and " + timeCodes.doubt + "; "
                + TfStringify(timeCodes.perSecond) + " is assumed");
    }
    return array;
}

} // namespace

std::array<double, 2> HdOocPTReadShutterTimes(const HdSceneIndexBase& scene, const SdfPath& camera)
{
    const auto& tokens = *HdOocPTSceneTokens;
    std::array<double, 2> times {};
    const HdContainerDataSourceHandle container
        = camera.IsEmpty() ? nullptr : HdOocPTFindContainer(scene.GetPrim(camera).dataSource, { tokens.camera });
    // Front ends use different names.
    for (const auto& [open, close] : { std::pair(tokens.shutterOpen, tokens.shutterClose),
             std::pair(tokens.shutterOpenAttribute, tokens.shutterCloseAttribute) }) {
        HdOocPTConvert(HdOocPTRead(container, { open }), &times[0]);
        HdOocPTConvert(HdOocPTRead(container, { close }), &times[1]);
    }
    return times;
}

HdOocPTShutter HdOocPTReadShutter(const HdSceneIndexBase& scene, const SdfPath& camera, HdOocPTWarnings* warnings)
{
    HdOocPTShutter shutter;
    const std::array<double, 2> times = HdOocPTReadShutterTimes(scene, camera);
    shutter.open = times[0];
    shutter.close = times[1];
    if (!std::isfinite(shutter.open) || !std::isfinite(shutter.close) || shutter.close < shutter.open) {
        warnings->Add(camera, "its shutter closes before it opens, or at no finite time; nothing is blurred by motion");
        shutter.open = shutter.close = 0.0;
    }
    if (shutter.IsOpen()) {
        shutter.timeCodes = HdOocPTFindTimeCodes(scene, camera);
    }
    return shutter;
}

std::vector<HdSampledDataSource::Time> HdOocPTReadSampleTimes(
    const std::vector<HdSampledDataSourceHandle>& sources, const HdOocPTShutter& shutter)
{
    _Times times;
    for (const HdSampledDataSourceHandle& source : sources) {
        _AddTimes(_SampleTimes(source, shutter), &times);
    }
    return times;
}

HdOocPTTransformSamples HdOocPTReadTransformSamples(
    const HdContainerDataSourceHandle& container, const HdOocPTShutter& shutter)
{
    const auto& tokens = *HdOocPTSceneTokens;
    HdOocPTTransformSamples samples;
    const HdSampledDataSourceHandle source
        = HdSampledDataSource::Cast(HdOocPTFind(container, { tokens.xform, tokens.matrix }));
    for (const HdSampledDataSource::Time time : _SampleTimes(source, shutter)) {
        GfMatrix4d matrix(1.0);
        HdOocPTConvert(source->GetValue(time), &matrix);
        samples.emplace_back(shutter.Part(time), matrix);
    }
    return samples;
}

void HdOocPTFillMotion(const HdOocPTTransformSamples& samples, rust::Vec<double>* numbers)
{
    numbers->reserve(17 * samples.size());
    for (const auto& [time, transform] : samples) {
        numbers->push_back(time);
        for (int i = 0; i < 16; ++i) {
            numbers->push_back(transform.GetArray()[i]);
        }
    }
}

HdOocPTPointsMotionState HdOocPTReadPointsMotion(const HdOocPTPrimSource& source, bool hasWidths)
{
    const auto& tokens = *HdOocPTSceneTokens;
    HdOocPTPointsMotionState state;
    const HdOocPTShutter& shutter = source.shutter;
    if (!shutter.IsOpen()) {
        return state;
    }
    state.seconds = shutter.Seconds();
    state.velocities = _ReadRates(source, tokens.velocities);
    state.accelerations = _ReadRates(source, tokens.accelerations);
    if (!state.velocities.IsEmpty()) {
        return state;
    }
    const auto sampled = [&](const TfToken& name, const TfToken& value) {
        return HdSampledDataSource::Cast(HdOocPTFind(source.container, { tokens.primvars, name, value }));
    };
    const auto authored = [&](const TfToken& name) {
        const HdSampledDataSourceHandle values = sampled(name, tokens.indexedPrimvarValue);
        return values && !values->GetValue(0.0f).IsEmpty() ? values : sampled(name, tokens.primvarValue);
    };
    const HdSampledDataSourceHandle points = sampled(tokens.points, tokens.primvarValue);
    const HdSampledDataSourceHandle normals = authored(tokens.normals);
    const HdSampledDataSourceHandle widths = hasWidths ? authored(tokens.widths) : nullptr;
    const _Times normalTimes = _SampleTimes(normals, shutter);
    const _Times widthTimes = _SampleTimes(widths, shutter);
    _Times times = _SampleTimes(points, shutter);
    if (hasWidths) {
        _AddTimes(normalTimes, &times);
        _AddTimes(widthTimes, &times);
    }
    for (const HdSampledDataSource::Time time : times) {
        const auto at = [&](const HdSampledDataSourceHandle& array, HdOocPTArrayRole role) {
            std::string reason;
            // Unusable arrays are reported when the arrays of the frame itself are read.
            return HdOocPTNormalizeArray(array ? array->GetValue(time) : VtValue(), role, &reason);
        };
        std::array<VtValue, 3> values { at(points, HdOocPTArrayRole::Vectors3),
            normalTimes.empty() ? VtValue() : at(normals, HdOocPTArrayRole::Vectors3),
            widthTimes.empty() ? VtValue() : at(widths, HdOocPTArrayRole::Scalars) };
        state.samples.emplace_back(shutter.Part(time), std::move(values));
    }
    return state;
}

oocpt::MotionDesc HdOocPTDescribePointsMotion(const HdOocPTPointsMotionState& state)
{
    oocpt::MotionDesc desc {};
    desc.samples.reserve(state.samples.size());
    for (const auto& [time, arrays] : state.samples) {
        desc.samples.push_back({ time, HdOocPTHoldArray(arrays[0]), HdOocPTHoldArray(arrays[1]),
            HdOocPTHoldArray(arrays[2]), nullptr, nullptr, nullptr });
    }
    desc.velocities = HdOocPTHoldArray(state.velocities);
    desc.accelerations = HdOocPTHoldArray(state.accelerations);
    desc.seconds = state.seconds;
    return desc;
}

HdOocPTInstancerMotionState HdOocPTReadInstancerMotion(const HdOocPTPrimSource& source)
{
    const auto& tokens = *HdOocPTSceneTokens;
    HdOocPTInstancerMotionState state;
    if (!source.shutter.IsOpen()) {
        return state;
    }
    state.velocities = _ReadRates(source, tokens.velocities);
    state.accelerations = _ReadRates(source, tokens.accelerations);
    state.angularVelocities = _ReadRates(source, tokens.angularVelocities);
    state.seconds = source.shutter.Seconds();
    const std::array<std::pair<TfToken, HdOocPTArrayRole>, 4> arrays { {
        { tokens.instanceTranslations, HdOocPTArrayRole::Vectors3 },
        { tokens.instanceRotations, HdOocPTArrayRole::Quaternions },
        { tokens.instanceScales, HdOocPTArrayRole::Vectors3 },
        { tokens.instanceTransforms, HdOocPTArrayRole::Matrices },
    } };
    std::array<HdSampledDataSourceHandle, 4> sources;
    _Times times;
    for (size_t i = 0; i < arrays.size(); ++i) {
        sources[i] = HdSampledDataSource::Cast(
            HdOocPTFind(source.container, { tokens.primvars, arrays[i].first, tokens.primvarValue }));
        _AddTimes(_SampleTimes(sources[i], source.shutter), &times);
    }
    for (const HdSampledDataSource::Time time : times) {
        std::array<VtValue, 4> values;
        for (size_t i = 0; i < arrays.size(); ++i) {
            std::string reason;
            const VtValue value = sources[i] ? sources[i]->GetValue(time) : VtValue();
            // Unusable arrays are reported when the arrays of the frame itself are read.
            values[i] = HdOocPTNormalizeArray(value, arrays[i].second, &reason);
            if (values[i].GetArraySize() == 0) {
                values[i] = VtValue();
            }
        }
        state.samples.emplace_back(source.shutter.Part(time), std::move(values));
    }
    return state;
}

oocpt::MotionDesc HdOocPTDescribeInstancerMotion(const HdOocPTInstancerMotionState& state)
{
    oocpt::MotionDesc desc {};
    desc.samples.reserve(state.samples.size());
    for (const auto& [time, arrays] : state.samples) {
        desc.samples.push_back({ time, HdOocPTHoldArray(arrays[0]), nullptr, nullptr, HdOocPTHoldArray(arrays[1]),
            HdOocPTHoldArray(arrays[2]), HdOocPTHoldArray(arrays[3]) });
    }
    desc.velocities = HdOocPTHoldArray(state.velocities);
    desc.accelerations = HdOocPTHoldArray(state.accelerations);
    desc.angular_velocities = HdOocPTHoldArray(state.angularVelocities);
    desc.seconds = state.seconds;
    return desc;
}

PXR_NAMESPACE_CLOSE_SCOPE
