// SPDX-License-Identifier: Apache-2.0
/// A prim that others refer to (camera, light, material, computation), as the render index keeps it.
#ifndef OOCPT_ABI_HD_SPRIM_H
#define OOCPT_ABI_HD_SPRIM_H

#include "pxr/imaging/hd/api.h"
#include "pxr/imaging/hd/types.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

PXR_NAMESPACE_OPEN_SCOPE

class HdRenderParam;
class HdSceneDelegate;

class HD_API HdSprim
{
public:
    explicit HdSprim(SdfPath const& id);
    virtual ~HdSprim();

    SdfPath const& GetId() const { return _id; }

    virtual void Sync(HdSceneDelegate* delegate, HdRenderParam* renderParam, HdDirtyBits* dirtyBits) = 0;
    virtual void Finalize(HdRenderParam* renderParam);
    virtual HdDirtyBits GetInitialDirtyBitsMask() const = 0;

private:
    SdfPath _id;
};

static_assert(sizeof(HdSprim) == 0x10);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
