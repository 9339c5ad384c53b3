// SPDX-License-Identifier: Apache-2.0
#include "hdOocPT/rendererPlugin.h"

#include "hdOocPT/guard.h"
#include "hdOocPT/renderDelegate.h"
#include "pxr/base/tf/registryManager.h"
#include "pxr/base/tf/type.h"
#include "pxr/imaging/hd/rendererPluginRegistry.h"

PXR_NAMESPACE_OPEN_SCOPE

TF_REGISTRY_FUNCTION(TfType)
{
    HdRendererPluginRegistry::Define<HdOocPTRendererPlugin>();
}

HdRenderDelegate* HdOocPTRendererPlugin::CreateRenderDelegate()
{
    return CreateRenderDelegate(HdRenderSettingsMap());
}

HdRenderDelegate* HdOocPTRendererPlugin::CreateRenderDelegate(HdRenderSettingsMap const& settingsMap)
{
    return HdOocPTGuard("creating the render delegate", static_cast<HdRenderDelegate*>(nullptr),
        [&]() -> HdRenderDelegate* { return new HdOocPTRenderDelegate(settingsMap); });
}

void HdOocPTRendererPlugin::DeleteRenderDelegate(HdRenderDelegate* renderDelegate)
{
    delete renderDelegate;
}

bool HdOocPTRendererPlugin::IsSupported(HDOOCPT_IS_SUPPORTED_PARAMETERS) const
{
    return true;
}

PXR_NAMESPACE_CLOSE_SCOPE
