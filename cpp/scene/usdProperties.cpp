// SPDX-License-Identifier: Apache-2.0
#include "scene/usdProperties.h"

#include "pxr/base/vt/array.h"
#include "pxr/imaging/hd/sceneDelegate.h"
#include "scene/dataSource.h"
#include "scene/tokens.h"

#include <cstring>
#include <typeinfo>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

bool _IsUsdImaging(const HdSceneDelegate& delegate)
{
    // UsdImaging is not linked to the shim, so its class is known by name alone.
    return std::strstr(typeid(delegate).name(), "18UsdImagingDelegate") != nullptr;
}

} // namespace

HdOocPTUsdProperties::HdOocPTUsdProperties(const HdOocPTPrimSource& source)
    : _path(source.path)
{
    const VtValue value = HdOocPTRead(source.container, { HdOocPTSceneTokens->sceneDelegate });
    if (value.IsHolding<HdSceneDelegate*>()) {
        HdSceneDelegate* const delegate = value.UncheckedGet<HdSceneDelegate*>();
        _delegate = delegate && _IsUsdImaging(*delegate) ? delegate : nullptr;
    }
}

VtValue HdOocPTUsdProperties::Get(const TfToken& name) const
{
    return _delegate ? _delegate->Get(_path, name) : VtValue();
}

VtValue HdOocPTUsdProperties::GetIndexed(const TfToken& name, VtValue* indices) const
{
    VtArray<int> found;
    VtValue values = _delegate ? _delegate->GetIndexedPrimvar(_path, name, &found) : VtValue();
    *indices = found.empty() ? VtValue() : VtValue::Take(found);
    return values;
}

PXR_NAMESPACE_CLOSE_SCOPE
