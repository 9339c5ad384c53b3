// SPDX-License-Identifier: Apache-2.0
/// What a render pass is asked to draw: camera, framing, outputs.
#ifndef OOCPT_ABI_HD_RENDER_PASS_STATE_H
#define OOCPT_ABI_HD_RENDER_PASS_STATE_H

#include "pxr/base/gf/matrix4d.h"
#include "pxr/base/gf/vec4d.h"
#include "pxr/imaging/cameraUtil/framing.h"
#include "pxr/imaging/hd/aov.h"
#include "pxr/imaging/hd/api.h"
#include "pxr/imaging/hd/resourceRegistry.h"
#include "pxr/pxr.h"

#include <memory>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

class HdCamera;

class HD_API HdRenderPassState
{
public:
    HdRenderPassState();
    virtual ~HdRenderPassState();

    virtual void Prepare(HdResourceRegistrySharedPtr const& registry);
    virtual GfMatrix4d GetWorldToViewMatrix() const;

    /// GL clip space, with the framing and the window policy applied.
    virtual GfMatrix4d GetProjectionMatrix() const;
    virtual std::vector<GfVec4d> GetClipPlanes() const;

    HdCamera const* GetCamera() const { return _camera; }
    CameraUtilFraming const& GetFraming() const { return _framing; }
    HdRenderPassAovBindingVector const& GetAovBindings() const;

    void SetCamera(HdCamera const* camera);
    void SetFraming(CameraUtilFraming const& framing);
    void SetAovBindings(HdRenderPassAovBindingVector const& aovBindings);

private:
    HdCamera const* _camera;
    unsigned char _opaqueBeforeFraming[0x10];
    CameraUtilFraming _framing;
    unsigned char _opaqueAfterFraming[0x180 - 0x44];
};

using HdRenderPassStateSharedPtr = std::shared_ptr<HdRenderPassState>;

static_assert(sizeof(HdRenderPassState) == 0x180);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
