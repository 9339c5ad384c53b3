// SPDX-License-Identifier: Apache-2.0
/// Entry point of the plugin library: Hydra finds "OocPT" by this class.
#ifndef HDOOCPT_RENDERER_PLUGIN_H
#define HDOOCPT_RENDERER_PLUGIN_H

#include "hdOocPT/compat.h"
#include "pxr/imaging/hd/rendererPlugin.h"
#include "pxr/pxr.h"

#include <string>

PXR_NAMESPACE_OPEN_SCOPE

/// Stateless. Threads: the host's only.
class HdOocPTRendererPlugin final : public HdRendererPlugin
{
public:
    HdRenderDelegate* CreateRenderDelegate() override;
    HdRenderDelegate* CreateRenderDelegate(HdRenderSettingsMap const& settingsMap) override;
    void DeleteRenderDelegate(HdRenderDelegate* renderDelegate) override;

    /// Always true: Hydra asks about the host's own drawing, and OocPT brings its own Vulkan device. On a machine
    /// without a usable device, the first image request reports it, with the reason.
    using HdRendererPlugin::IsSupported;
    bool IsSupported(HDOOCPT_IS_SUPPORTED_PARAMETERS) const override;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
