// SPDX-License-Identifier: Apache-2.0
/// Commands that a delegate offers in its host's menus.
#ifndef OOCPT_ABI_HD_COMMAND_H
#define OOCPT_ABI_HD_COMMAND_H

#include "pxr/base/tf/token.h"
#include "pxr/base/vt/dictionary.h"
#include "pxr/base/vt/value.h"
#include "pxr/pxr.h"

#include <string>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

using HdCommandArgs = VtDictionary;

struct HdCommandArgDescriptor
{
    TfToken argName;
    VtValue defaultValue;
};

using HdCommandArgDescriptors = std::vector<HdCommandArgDescriptor>;

struct HdCommandDescriptor
{
    explicit HdCommandDescriptor(TfToken const& name, std::string const& description = std::string())
        : commandName(name)
        , commandDescription(description)
    {
    }

    TfToken commandName;
    std::string commandDescription;
    HdCommandArgDescriptors commandArgs;
};

using HdCommandDescriptors = std::vector<HdCommandDescriptor>;

static_assert(sizeof(HdCommandArgDescriptor) == 0x18);
static_assert(sizeof(HdCommandDescriptor) == 0x40);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
