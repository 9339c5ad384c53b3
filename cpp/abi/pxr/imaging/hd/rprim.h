// SPDX-License-Identifier: Apache-2.0
/// A prim that is drawn, as the render index keeps it.
#ifndef OOCPT_ABI_HD_RPRIM_H
#define OOCPT_ABI_HD_RPRIM_H

#include "pxr/base/tf/token.h"
#include "pxr/imaging/hd/api.h"
#include "pxr/imaging/hd/types.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

#include <cstdint>

PXR_NAMESPACE_OPEN_SCOPE

class HdRenderParam;
class HdSceneDelegate;

class HD_API HdRprim
{
public:
    explicit HdRprim(SdfPath const& id);
    virtual ~HdRprim();

    virtual HdDirtyBits GetInitialDirtyBitsMask() const = 0;

    /// Called in parallel from worker threads; must leave `dirtyBits` clean.
    virtual void Sync(
        HdSceneDelegate* delegate, HdRenderParam* renderParam, HdDirtyBits* dirtyBits, TfToken const& reprToken)
        = 0;
    virtual void Finalize(HdRenderParam* renderParam);
    virtual TfTokenVector const& GetBuiltinPrimvarNames() const = 0;
    virtual void UpdateRenderTag(HdSceneDelegate* delegate, HdRenderParam* renderParam);

    SdfPath const& GetId() const { return _id; }

    /// The number that the primId output carries; given by the render index.
    int32_t GetPrimId() const { return _primId; }

protected:
    virtual HdDirtyBits _PropagateDirtyBits(HdDirtyBits bits) const = 0;
    virtual void _InitRepr(TfToken const& reprToken, HdDirtyBits* dirtyBits) = 0;

private:
    unsigned char _opaqueBeforePrimId[0x10];
    int32_t _primId;
    unsigned char _opaqueBeforeId[0x178 - 0x1c];
    SdfPath _id;
    unsigned char _opaqueAfterId[0x1d0 - 0x180];
};

static_assert(sizeof(HdRprim) == 0x1d0);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
