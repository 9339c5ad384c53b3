// SPDX-License-Identifier: Apache-2.0
/// What an output is made of, and where a render pass writes it.
#ifndef OOCPT_ABI_HD_AOV_H
#define OOCPT_ABI_HD_AOV_H

#include "pxr/base/tf/hashmap.h"
#include "pxr/base/tf/token.h"
#include "pxr/base/vt/value.h"
#include "pxr/imaging/hd/types.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

#include <cstddef>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

class HdRenderBuffer;

using HdAovSettingsMap = TfHashMap<TfToken, VtValue, TfToken::HashFunctor>;

struct HdAovDescriptor
{
    HdAovDescriptor()
        : format(HdFormatInvalid)
        , multiSampled(false)
    {
    }
    HdAovDescriptor(HdFormat pixelFormat, bool wantsSamples, VtValue const& clear)
        : format(pixelFormat)
        , multiSampled(wantsSamples)
        , clearValue(clear)
    {
    }

    HdFormat format;
    bool multiSampled;
    VtValue clearValue;
    HdAovSettingsMap aovSettings;
};

/// The pass clears the buffer to clearValue; an empty value means that it keeps what is there.
struct HdRenderPassAovBinding
{
    TfToken aovName;
    HdRenderBuffer* renderBuffer = nullptr;
    SdfPath renderBufferId;
    VtValue clearValue;
    HdAovSettingsMap aovSettings;
};

using HdRenderPassAovBindingVector = std::vector<HdRenderPassAovBinding>;

static_assert(sizeof(HdAovSettingsMap) == 0x28);
static_assert(sizeof(HdAovDescriptor) == 0x40);
static_assert(offsetof(HdRenderPassAovBinding, renderBuffer) == 0x8);
static_assert(offsetof(HdRenderPassAovBinding, clearValue) == 0x18);
static_assert(sizeof(HdRenderPassAovBinding) == 0x50);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
