// SPDX-License-Identifier: Apache-2.0
/// Where a plugin library tells Hydra how to make its plugin object.
#ifndef OOCPT_ABI_HF_PLUGIN_REGISTRY_H
#define OOCPT_ABI_HF_PLUGIN_REGISTRY_H

#include "pxr/base/tf/type.h"
#include "pxr/imaging/hd/api.h"
#include "pxr/imaging/hf/pluginBase.h"
#include "pxr/pxr.h"

#include <functional>

PXR_NAMESPACE_OPEN_SCOPE

class HD_API HfPluginRegistry
{
public:
    /// Declares T to TfType and stores its factory there. Call it from TF_REGISTRY_FUNCTION(TfType).
    template <typename T, typename PluginBase>
    static void Define()
    {
        TfType type = TfType::Define<T, TfType::Bases<PluginBase>>();
        std::function<HfPluginBase*()> factory = [] { return static_cast<HfPluginBase*>(new T); };
        _SetFactory(type, factory);
    }

private:
    static void _SetFactory(TfType& type, std::function<HfPluginBase*()>& factory);
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
