// SPDX-License-Identifier: Apache-2.0
/// The outputs that OocPT renders, and the conversion of their pixels to the format of a host's buffer.
#ifndef HDOOCPT_AOV_H
#define HDOOCPT_AOV_H

#include "pxr/base/tf/token.h"
#include "pxr/base/vt/value.h"
#include "pxr/imaging/hd/aov.h"
#include "pxr/imaging/hd/types.h"
#include "pxr/pxr.h"

#include <cstddef>

PXR_NAMESPACE_OPEN_SCOPE

/// One output in the renderer's own format.
struct HdOocPTAov
{
    TfToken name;
    HdFormat format;
    VtValue clearValue;
};

/// The output that a host binds: its name, or `lpe:` and the light path expression where its settings have one.
TfToken HdOocPTAovName(HdRenderPassAovBinding const& binding);

/// The output of that name; null if OocPT does not render it. `primIdFloat`, `instanceIdFloat` and `elementIdFloat` are
/// those of the ids.
HdOocPTAov const* HdOocPTFindAov(TfToken const& name);

/// What a host is told of the output of that name; of invalid format if OocPT does not render it.
HdAovDescriptor HdOocPTDescribeAov(TfToken const& name);

/// Returns true if HdOocPTConvertPixels can write this format.
bool HdOocPTIsStorable(HdFormat format);

/// Copies `pixelCount` tightly packed pixels. Components that the source lacks become 0; 8-bit formats clamp. Returns
/// false, and writes nothing, if one of the two formats is not storable. The arrays must not overlap.
bool HdOocPTConvertPixels(
    void const* source, HdFormat sourceFormat, void* target, HdFormat targetFormat, size_t pixelCount);

/// Fills the target with a clear value: a scalar or a vector of float, double or int; anything else means zero.
void HdOocPTFillPixels(VtValue const& clearValue, void* target, HdFormat targetFormat, size_t pixelCount);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
