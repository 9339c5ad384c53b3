// SPDX-License-Identifier: Apache-2.0
/// The object by which Hydra finds a renderer and makes its delegates.
#ifndef OOCPT_ABI_HD_RENDERER_PLUGIN_H
#define OOCPT_ABI_HD_RENDERER_PLUGIN_H

#include "pxr/imaging/hd/api.h"
#include "pxr/imaging/hd/renderDelegate.h"
#include "pxr/imaging/hf/pluginBase.h"
#include "pxr/pxr.h"

#include <string>

PXR_NAMESPACE_OPEN_SCOPE

#if PXR_VERSION >= 2603
struct HdRendererCreateArgs;
#endif

class HD_API HdRendererPlugin : public HfPluginBase
{
public:
    ~HdRendererPlugin() override;

#if PXR_VERSION >= 2603
    /// Slots that were added before the old ones; Hydra calls the last of the three.
    virtual bool IsSupported(HdContainerDataSourceHandle const& createArgs, std::string* reasonWhyNot) const;
    virtual HdContainerDataSourceHandle GetSceneIndexInputArgs() const;
    virtual bool IsSupported(HdRendererCreateArgs const& createArgs, std::string* reasonWhyNot) const = 0;
#endif
    virtual HdRenderDelegate* CreateRenderDelegate() = 0;
    virtual HdRenderDelegate* CreateRenderDelegate(HdRenderSettingsMap const& settingsMap);
    virtual void DeleteRenderDelegate(HdRenderDelegate* renderDelegate) = 0;

    /// `gpuEnabled` says whether the host itself draws with a GPU.
#if PXR_VERSION >= 2603
    virtual bool IsSupported(bool gpuEnabled = true) const;

protected:
    /// Its result is a pointer, which nobody here looks into.
    virtual void* _CreateRenderer(HdSceneIndexBaseRefPtr const& sceneIndex, HdContainerDataSourceHandle const& args);
#else
    virtual bool IsSupported(bool gpuEnabled = true) const = 0;
#endif
};

static_assert(sizeof(HdRendererPlugin) == 0x8);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
