// SPDX-License-Identifier: Apache-2.0
/// The set of prims that a render pass draws. Passed through by reference; its members are not declared.
#ifndef OOCPT_ABI_HD_RPRIM_COLLECTION_H
#define OOCPT_ABI_HD_RPRIM_COLLECTION_H

#include "pxr/imaging/hd/api.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

class HdRprimCollection;

PXR_NAMESPACE_CLOSE_SCOPE

#endif
