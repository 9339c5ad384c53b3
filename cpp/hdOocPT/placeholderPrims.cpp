// SPDX-License-Identifier: Apache-2.0
#include "hdOocPT/placeholderPrims.h"

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// Nothing is pulled through these prims, so nothing is ever dirty.
constexpr HdDirtyBits _clean = 0;

} // namespace

HdOocPTPlaceholderRprim::HdOocPTPlaceholderRprim(SdfPath const& id)
    : HdRprim(id)
{
}

HdOocPTPlaceholderRprim::~HdOocPTPlaceholderRprim() = default;

HdDirtyBits HdOocPTPlaceholderRprim::GetInitialDirtyBitsMask() const
{
    return _clean;
}

void HdOocPTPlaceholderRprim::Sync(HdSceneDelegate*, HdRenderParam*, HdDirtyBits* dirtyBits, TfToken const&)
{
    *dirtyBits = _clean;
}

TfTokenVector const& HdOocPTPlaceholderRprim::GetBuiltinPrimvarNames() const
{
    static TfTokenVector const none;
    return none;
}

HdDirtyBits HdOocPTPlaceholderRprim::_PropagateDirtyBits(HdDirtyBits bits) const
{
    return bits;
}

void HdOocPTPlaceholderRprim::_InitRepr(TfToken const&, HdDirtyBits*) { }

HdOocPTPlaceholderSprim::HdOocPTPlaceholderSprim(SdfPath const& id)
    : HdSprim(id)
{
}

HdOocPTPlaceholderSprim::~HdOocPTPlaceholderSprim() = default;

void HdOocPTPlaceholderSprim::Sync(HdSceneDelegate*, HdRenderParam*, HdDirtyBits* dirtyBits)
{
    *dirtyBits = _clean;
}

HdDirtyBits HdOocPTPlaceholderSprim::GetInitialDirtyBitsMask() const
{
    return _clean;
}

HdOocPTPlaceholderRenderSettings::HdOocPTPlaceholderRenderSettings(SdfPath const& id)
    : HdRenderSettings(id)
{
}

HdOocPTPlaceholderRenderSettings::~HdOocPTPlaceholderRenderSettings() = default;

PXR_NAMESPACE_CLOSE_SCOPE
