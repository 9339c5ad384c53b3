// SPDX-License-Identifier: Apache-2.0
/// Hydra data sources: the read interface of a scene index's prims. Declared after the binary (cpp/abi/README.md): the
/// order of virtual functions is the runtime's.
///
/// All of them are reference-counted by std::shared_ptr and may be read from several threads at once.
#ifndef OOCPT_ABI_HD_DATA_SOURCE_H
#define OOCPT_ABI_HD_DATA_SOURCE_H

#include "pxr/base/tf/token.h"
#include "pxr/base/vt/value.h"
#include "pxr/imaging/hd/api.h"
#include "pxr/pxr.h"

#include <cstddef>
#include <memory>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

class HdDataSourceLocator;

/// Root of the hierarchy. Its virtual table holds the two destructors only.
class HD_API HdDataSourceBase
{
public:
    using Handle = std::shared_ptr<HdDataSourceBase>;

    virtual ~HdDataSourceBase() = 0;

    static Handle Cast(Handle const& source) { return source; }

protected:
    HdDataSourceBase() = default;
};

using HdDataSourceBaseHandle = HdDataSourceBase::Handle;

/// Named children.
class HD_API HdContainerDataSource : public HdDataSourceBase
{
public:
    using Handle = std::shared_ptr<HdContainerDataSource>;

    static Handle Cast(HdDataSourceBaseHandle const& source)
    {
        return std::dynamic_pointer_cast<HdContainerDataSource>(source);
    }

    virtual std::vector<TfToken> GetNames() = 0;
    virtual HdDataSourceBaseHandle Get(TfToken const& name) = 0;

    /// Walks `locator` down from `container`; null when a step is missing.
    static HdDataSourceBaseHandle Get(Handle const& container, HdDataSourceLocator const& locator);
};

using HdContainerDataSourceHandle = HdContainerDataSource::Handle;

/// Numbered children.
class HD_API HdVectorDataSource : public HdDataSourceBase
{
public:
    using Handle = std::shared_ptr<HdVectorDataSource>;

    static Handle Cast(HdDataSourceBaseHandle const& source)
    {
        return std::dynamic_pointer_cast<HdVectorDataSource>(source);
    }

    virtual std::size_t GetNumElements() = 0;
    virtual HdDataSourceBaseHandle GetElement(std::size_t element) = 0;
};

using HdVectorDataSourceHandle = HdVectorDataSource::Handle;

/// A value that may vary over the shutter. Times are offsets from the current frame, in frames.
class HD_API HdSampledDataSource : public HdDataSourceBase
{
public:
    using Handle = std::shared_ptr<HdSampledDataSource>;
    using Time = float;

    static Handle Cast(HdDataSourceBaseHandle const& source)
    {
        return std::dynamic_pointer_cast<HdSampledDataSource>(source);
    }

    virtual VtValue GetValue(Time shutterOffset) = 0;

    /// False when the value does not change within the interval; then GetValue(0) is the value.
    virtual bool GetContributingSampleTimesForInterval(Time startTime, Time endTime, std::vector<Time>* outSampleTimes)
        = 0;
};

using HdSampledDataSourceHandle = HdSampledDataSource::Handle;

/// A sampled value of a type known at compile time.
template <typename T>
class HD_API HdTypedSampledDataSource : public HdSampledDataSource
{
public:
    using Handle = std::shared_ptr<HdTypedSampledDataSource<T>>;
    using Type = T;

    static Handle Cast(HdDataSourceBaseHandle const& source)
    {
        return std::dynamic_pointer_cast<HdTypedSampledDataSource<T>>(source);
    }

    virtual T GetTypedValue(Time shutterOffset) = 0;
};

static_assert(sizeof(HdDataSourceBase) == 0x8);
static_assert(sizeof(HdContainerDataSource) == 0x8);
static_assert(sizeof(HdSampledDataSource) == 0x8);
static_assert(sizeof(HdDataSourceBaseHandle) == 0x10);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
