// SPDX-License-Identifier: Apache-2.0
/// The object by which Hydra finds a renderer and makes its delegates.
#ifndef OOCPT_ABI_HD_RENDERER_PLUGIN_H
#define OOCPT_ABI_HD_RENDERER_PLUGIN_H

#include "pxr/imaging/hd/api.h"
#include "pxr/imaging/hd/renderDelegate.h"
#include "pxr/imaging/hf/pluginBase.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

class HD_API HdRendererPlugin : public HfPluginBase
{
public:
    ~HdRendererPlugin() override;

    virtual HdRenderDelegate* CreateRenderDelegate() = 0;
    virtual HdRenderDelegate* CreateRenderDelegate(HdRenderSettingsMap const& settingsMap);
    virtual void DeleteRenderDelegate(HdRenderDelegate* renderDelegate) = 0;

    /// `gpuEnabled` says whether the host itself draws with a GPU.
    virtual bool IsSupported(bool gpuEnabled = true) const = 0;
};

static_assert(sizeof(HdRendererPlugin) == 0x8);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
