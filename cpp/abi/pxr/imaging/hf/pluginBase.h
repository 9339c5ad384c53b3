// SPDX-License-Identifier: Apache-2.0
/// Root of Hydra's plugin types.
#ifndef OOCPT_ABI_HF_PLUGIN_BASE_H
#define OOCPT_ABI_HF_PLUGIN_BASE_H

#include "pxr/imaging/hd/api.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

class HD_API HfPluginBase
{
public:
    virtual ~HfPluginBase();
};

static_assert(sizeof(HfPluginBase) == 0x8);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
