// SPDX-License-Identifier: Apache-2.0
/// A second viewport in the render index of an engine, with a render pass and buffers of its own, which OpenUSD's
/// Python cannot make. Driven by tests/hydra/test_viewports.py, on the thread of the engine.
#include "pxr/base/gf/vec3i.h"
#include "pxr/imaging/hd/camera.h"
#include "pxr/imaging/hd/renderBuffer.h"
#include "pxr/imaging/hd/renderDelegate.h"
#include "pxr/imaging/hd/renderIndex.h"
#include "pxr/imaging/hd/renderPass.h"
#include "pxr/imaging/hd/renderPassState.h"
#include "pxr/imaging/hd/rprimCollection.h"

#include <cstring>

PXR_NAMESPACE_OPEN_SCOPE

/// Larger than the runtime's. Never destroyed.
class HdRprimCollection
{
public:
    HD_API HdRprimCollection();

private:
    unsigned char _opaque[0x100];
};

PXR_NAMESPACE_CLOSE_SCOPE

PXR_NAMESPACE_USING_DIRECTIVE

namespace {

struct Viewport
{
    HdRenderIndex* index;
    HdRenderDelegate* delegate;
    SdfPath camera;
    HdRenderPassSharedPtr pass;
    HdRenderPassStateSharedPtr state;
    HdRenderBuffer* buffer;
};

} // namespace

extern "C" {

__attribute__((visibility("default"))) void oocpt_viewport_resize(Viewport* viewport, int width, int height)
{
    viewport->buffer->Allocate(GfVec3i(width, height, 1), HdFormatFloat32Vec4, false);
    CameraUtilFraming framing;
    framing.displayWindow = GfRange2f(GfVec2f(0, 0), GfVec2f(float(width), float(height)));
    framing.dataWindow = GfRect2i(GfVec2i(0, 0), width, height);
    framing.pixelAspectRatio = 1.0f;
    viewport->state->SetFraming(framing);
}

__attribute__((visibility("default"))) Viewport* oocpt_viewport_open(
    HdRenderIndex* index, char const* camera, int width, int height)
{
    auto* const viewport = new Viewport { index, index->GetRenderDelegate(), SdfPath(camera), {}, {}, nullptr };
    static HdRprimCollection const& all = *new HdRprimCollection;
    viewport->pass = viewport->delegate->CreateRenderPass(index, all);
    viewport->state = viewport->delegate->CreateRenderPassState();
    HdBprim* const made = viewport->delegate->CreateBprim(TfToken("renderBuffer"), SdfPath("/viewport/color"));
    viewport->buffer = static_cast<HdRenderBuffer*>(made);
    HdRenderPassAovBinding binding;
    binding.aovName = TfToken("color");
    binding.renderBuffer = viewport->buffer;
    viewport->state->SetAovBindings({ binding });
    oocpt_viewport_resize(viewport, width, height);
    return viewport;
}

__attribute__((visibility("default"))) bool oocpt_viewport_step(Viewport* viewport)
{
    HdSprim* const camera = viewport->index->GetSprim(TfToken("camera"), viewport->camera);
    viewport->state->SetCamera(static_cast<HdCamera*>(camera));
    viewport->pass->Execute(viewport->state, { TfToken("geometry"), TfToken("proxy") });
    return viewport->pass->IsConverged();
}

/// Copies the pixels, bottom row first; true if the buffer says that they are final.
__attribute__((visibility("default"))) bool oocpt_viewport_read(Viewport* viewport, float* pixels)
{
    HdRenderBuffer& buffer = *viewport->buffer;
    buffer.Resolve();
    std::memcpy(pixels, buffer.Map(), size_t(buffer.GetWidth()) * buffer.GetHeight() * 4 * sizeof(float));
    buffer.Unmap();
    return buffer.IsConverged();
}

__attribute__((visibility("default"))) void oocpt_viewport_close(Viewport* viewport)
{
    viewport->pass.reset();
    viewport->state.reset();
    viewport->delegate->DestroyBprim(viewport->buffer);
    delete viewport;
}
}
