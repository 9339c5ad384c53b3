// SPDX-License-Identifier: Apache-2.0
/// The registry of shaders.
#ifndef OOCPT_ABI_SDR_REGISTRY_H
#define OOCPT_ABI_SDR_REGISTRY_H

#include "pxr/base/tf/token.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdr/api.h"

#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

class SdrShaderNode;

class SdrRegistry
{
public:
    SdrRegistry() = delete;

    SDR_API static SdrRegistry& GetInstance();

    SDR_API SdrShaderNode const* GetShaderNodeByIdentifier(
        TfToken const& identifier, std::vector<TfToken> const& typePriority = {});
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
