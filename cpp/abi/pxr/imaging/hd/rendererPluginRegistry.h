// SPDX-License-Identifier: Apache-2.0
/// Registry of renderers.
#ifndef OOCPT_ABI_HD_RENDERER_PLUGIN_REGISTRY_H
#define OOCPT_ABI_HD_RENDERER_PLUGIN_REGISTRY_H

#include "pxr/imaging/hd/rendererPlugin.h"
#include "pxr/imaging/hf/pluginRegistry.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

class HD_API HdRendererPluginRegistry : public HfPluginRegistry
{
public:
    template <typename T>
    static void Define()
    {
        HfPluginRegistry::Define<T, HdRendererPlugin>();
    }
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
