// SPDX-License-Identifier: Apache-2.0
/// The render settings prim as the render index keeps it.
#ifndef OOCPT_ABI_HD_RENDER_SETTINGS_H
#define OOCPT_ABI_HD_RENDER_SETTINGS_H

#include "pxr/base/vt/dictionary.h"
#include "pxr/imaging/hd/bprim.h"

PXR_NAMESPACE_OPEN_SCOPE

class HD_API HdRenderSettings : public HdBprim
{
public:
    ~HdRenderSettings() override;

    /// True for the one prim that the host renders with.
    bool IsActive() const;

    /// Attributes of the prim whose namespace is one of GetRenderSettingsNamespaces().
    VtDictionary const& GetNamespacedSettings() const;

    void Sync(HdSceneDelegate* delegate, HdRenderParam* renderParam, HdDirtyBits* dirtyBits) override;
    HdDirtyBits GetInitialDirtyBitsMask() const override;

protected:
    explicit HdRenderSettings(SdfPath const& id);

    /// Runs after the base class read what `dirtyBits` says.
    virtual void _Sync(HdSceneDelegate* delegate, HdRenderParam* renderParam, HdDirtyBits const* dirtyBits);

private:
    unsigned char _opaque[0x90];
};

static_assert(sizeof(HdRenderSettings) == 0xa0);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
