// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_USD_PROPERTIES_H
#define HDOOCPT_SCENE_USD_PROPERTIES_H

#include "pxr/base/tf/token.h"
#include "pxr/base/vt/value.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"
#include "scene/primReader.h"

PXR_NAMESPACE_OPEN_SCOPE

class HdSceneDelegate;

/// Properties of the USD prim that a prim of the legacy front end was made from, at the current time. UsdImaging's
/// scene delegate turns implicit shapes into meshes and drops primvars of other types than the schema's; but it returns
/// any property by name. No other scene delegate is asked: they need not expect it.
class HdOocPTUsdProperties
{
public:
    explicit HdOocPTUsdProperties(const HdOocPTPrimSource& source);

    /// True if there is a delegate to ask.
    explicit operator bool() const { return _delegate != nullptr; }

    /// The value of a property; empty if the prim has none of the name, or no value for it.
    VtValue Get(const TfToken& name) const;

    /// A primvar by its full name: its values, and its indices if it has some.
    VtValue GetIndexed(const TfToken& name, VtValue* indices) const;

private:
    SdfPath _path;
    HdSceneDelegate* _delegate = nullptr;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
