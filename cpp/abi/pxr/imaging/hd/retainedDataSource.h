// SPDX-License-Identifier: Apache-2.0
/// Data sources that hold their values: what the shim passes to scene indices as arguments.
#ifndef OOCPT_ABI_HD_RETAINED_DATA_SOURCE_H
#define OOCPT_ABI_HD_RETAINED_DATA_SOURCE_H

#include "pxr/imaging/hd/api.h"
#include "pxr/imaging/hd/dataSource.h"
#include "pxr/pxr.h"

#include <cstddef>
#include <memory>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

/// Container with fixed children; made by the runtime, never derived from here.
class HD_API HdRetainedContainerDataSource : public HdContainerDataSource
{
public:
    using Handle = std::shared_ptr<HdRetainedContainerDataSource>;

    static Handle New(std::size_t count, TfToken const* names, HdDataSourceBaseHandle const* values);

private:
    HdRetainedContainerDataSource() = default;
};

/// A constant value of type T. Defined here in full: it is a template, and the runtime only needs its interface.
template <typename T>
class HdRetainedTypedSampledDataSource : public HdTypedSampledDataSource<T>
{
public:
    using Handle = std::shared_ptr<HdRetainedTypedSampledDataSource<T>>;
    using Time = HdSampledDataSource::Time;

    static Handle New(T const& value) { return Handle(new HdRetainedTypedSampledDataSource<T>(value)); }

    VtValue GetValue(Time) override { return VtValue(_value); }
    T GetTypedValue(Time) override { return _value; }
    bool GetContributingSampleTimesForInterval(Time, Time, std::vector<Time>*) override { return false; }

private:
    explicit HdRetainedTypedSampledDataSource(T const& value)
        : _value(value)
    {
    }

    T _value;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
