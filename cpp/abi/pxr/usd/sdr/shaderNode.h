// SPDX-License-Identifier: Apache-2.0
/// A node of the registry of shaders. Only the registry makes them.
#ifndef OOCPT_ABI_SDR_SHADER_NODE_H
#define OOCPT_ABI_SDR_SHADER_NODE_H

#include "pxr/pxr.h"
#include "pxr/usd/sdr/api.h"

#include <string>

PXR_NAMESPACE_OPEN_SCOPE

/// The runtime's class has virtual functions, this one among them: it is called by its qualified name only.
class SdrShaderNode
{
public:
    SdrShaderNode() = delete;

    SDR_API std::string GetInfoString() const;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
