// SPDX-License-Identifier: Apache-2.0
/// Prims that only Hydra's render index needs: the scene is read from the terminal scene index.
#ifndef HDOOCPT_PLACEHOLDER_PRIMS_H
#define HDOOCPT_PLACEHOLDER_PRIMS_H

#include "pxr/base/tf/token.h"
#include "pxr/imaging/hd/renderSettings.h"
#include "pxr/imaging/hd/rprim.h"
#include "pxr/imaging/hd/sprim.h"
#include "pxr/imaging/hd/types.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

PXR_NAMESPACE_OPEN_SCOPE

/// Stands for a drawn prim. Only the prim id that the render index gives it is used.
class HdOocPTPlaceholderRprim final : public HdRprim
{
public:
    explicit HdOocPTPlaceholderRprim(SdfPath const& id);
    ~HdOocPTPlaceholderRprim() override;

    HdDirtyBits GetInitialDirtyBitsMask() const override;
    void Sync(HdSceneDelegate* delegate, HdRenderParam* renderParam, HdDirtyBits* dirtyBits,
        TfToken const& reprToken) override;
    TfTokenVector const& GetBuiltinPrimvarNames() const override;

protected:
    HdDirtyBits _PropagateDirtyBits(HdDirtyBits bits) const override;
    void _InitRepr(TfToken const& reprToken, HdDirtyBits* dirtyBits) override;
};

/// Stands for a light, a material or a computation.
class HdOocPTPlaceholderSprim final : public HdSprim
{
public:
    explicit HdOocPTPlaceholderSprim(SdfPath const& id);
    ~HdOocPTPlaceholderSprim() override;

    void Sync(HdSceneDelegate* delegate, HdRenderParam* renderParam, HdDirtyBits* dirtyBits) override;
    HdDirtyBits GetInitialDirtyBitsMask() const override;
};

/// Stands for a RenderSettings prim. Hosts expect the real base class; the session reads the settings themselves.
class HdOocPTPlaceholderRenderSettings final : public HdRenderSettings
{
public:
    explicit HdOocPTPlaceholderRenderSettings(SdfPath const& id);
    ~HdOocPTPlaceholderRenderSettings() override;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
