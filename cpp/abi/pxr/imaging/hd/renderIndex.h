// SPDX-License-Identifier: Apache-2.0
/// Hydra's index of prims. Only looked into, never made or copied here.
#ifndef OOCPT_ABI_HD_RENDER_INDEX_H
#define OOCPT_ABI_HD_RENDER_INDEX_H

#include "pxr/base/tf/token.h"
#include "pxr/imaging/hd/api.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

PXR_NAMESPACE_OPEN_SCOPE

class HdBprim;
class HdRenderDelegate;
class HdRprim;
class HdSprim;

class HD_API HdRenderIndex
{
public:
    HdRenderIndex() = delete;

    /// Null when there is no such prim.
    HdRprim const* GetRprim(SdfPath const& id) const;
    HdSprim* GetSprim(TfToken const& typeId, SdfPath const& id) const;
    HdBprim* GetBprim(TfToken const& typeId, SdfPath const& bprimId) const;

    HdRenderDelegate* GetRenderDelegate() const;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
