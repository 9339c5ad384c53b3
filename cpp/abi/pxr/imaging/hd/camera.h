// SPDX-License-Identifier: Apache-2.0
/// Hydra's camera. It must be a real one: tasks read matrices and framing policy from it.
#ifndef OOCPT_ABI_HD_CAMERA_H
#define OOCPT_ABI_HD_CAMERA_H

#include "pxr/imaging/hd/sprim.h"

PXR_NAMESPACE_OPEN_SCOPE

class HD_API HdCamera : public HdSprim
{
public:
    explicit HdCamera(SdfPath const& id);
    ~HdCamera() override;

    void Sync(HdSceneDelegate* delegate, HdRenderParam* renderParam, HdDirtyBits* dirtyBits) override;
    HdDirtyBits GetInitialDirtyBitsMask() const override;

private:
    unsigned char _opaque[0x140];
};

static_assert(sizeof(HdCamera) == 0x150);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
