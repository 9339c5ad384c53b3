// SPDX-License-Identifier: Apache-2.0
/// Hydra's registry of shared GPU resources. The shim keeps an empty one, because hosts ask for it.
#ifndef OOCPT_ABI_HD_RESOURCE_REGISTRY_H
#define OOCPT_ABI_HD_RESOURCE_REGISTRY_H

#include "pxr/base/tf/token.h"
#include "pxr/base/vt/dictionary.h"
#include "pxr/imaging/hd/api.h"
#include "pxr/pxr.h"

#include <memory>
#include <string>

PXR_NAMESPACE_OPEN_SCOPE

class HD_API HdResourceRegistry
{
public:
    HdResourceRegistry();
    virtual ~HdResourceRegistry();

    virtual void InvalidateShaderRegistry();
    virtual void ReloadResource(TfToken const& resourceType, std::string const& path);
    virtual VtDictionary GetResourceAllocation() const;

protected:
    virtual void _Commit();
    virtual void _GarbageCollect();
};

using HdResourceRegistrySharedPtr = std::shared_ptr<HdResourceRegistry>;

static_assert(sizeof(HdResourceRegistry) == 0x8);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
