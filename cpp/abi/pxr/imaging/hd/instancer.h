// SPDX-License-Identifier: Apache-2.0
/// Hydra's instancer. The shim makes plain ones; the scene is read from the scene index.
#ifndef OOCPT_ABI_HD_INSTANCER_H
#define OOCPT_ABI_HD_INSTANCER_H

#include "pxr/imaging/hd/api.h"
#include "pxr/imaging/hd/types.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

PXR_NAMESPACE_OPEN_SCOPE

class HdRenderParam;
class HdSceneDelegate;

class HD_API HdInstancer
{
public:
    HdInstancer(HdSceneDelegate* delegate, SdfPath const& id);
    virtual ~HdInstancer();

    virtual void Sync(HdSceneDelegate* delegate, HdRenderParam* renderParam, HdDirtyBits* dirtyBits);
    virtual void Finalize(HdRenderParam* renderParam);
    virtual HdDirtyBits GetInitialDirtyBitsMask() const;

private:
    unsigned char _opaque[0x40];
};

static_assert(sizeof(HdInstancer) == 0x48);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
