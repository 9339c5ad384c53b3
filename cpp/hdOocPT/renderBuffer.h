// SPDX-License-Identifier: Apache-2.0
/// Hydra bprim "renderBuffer": the pixels of one output in host memory.
#ifndef HDOOCPT_RENDER_BUFFER_H
#define HDOOCPT_RENDER_BUFFER_H

#include "hdOocPT/aov.h"
#include "pxr/base/gf/vec3i.h"
#include "pxr/base/tf/token.h"
#include "pxr/base/vt/value.h"
#include "pxr/imaging/hd/renderBuffer.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

class HdOocPTSession;

/// Holds a copy of the renderer's newest image, taken by Resolve(), Map(), and IsConverged() before it returns true.
/// The render thread never writes here, so the host may read a mapped buffer while rendering goes on.
///
/// Memory that is mapped stays where it is, with what is in it, until the last Unmap, also if the buffer gets another
/// size or is finalized meanwhile: hosts convert pixels on threads of their own.
///
/// Threads: any; a host that resizes while another thread asks for width, height and pixels may get those of two sizes.
class HdOocPTRenderBuffer final : public HdRenderBuffer
{
public:
    HdOocPTRenderBuffer(SdfPath const& id, std::shared_ptr<HdOocPTSession> session);
    ~HdOocPTRenderBuffer() override;

    /// Says which output this buffer shows; null is an output that OocPT does not make: the buffer keeps the clear
    /// value. The buffer is cleared when the output changes, or when there is no image to show.
    void Bind(void const* viewport, HdOocPTAov const* aov, VtValue const& clearValue);

    /// Refuses, with an error and an empty buffer, sizes that are negative, deep, or beyond the limits of one image. An
    /// image of another size is stretched over the buffer until there is one of this size.
    bool Allocate(GfVec3i const& dimensions, HdFormat format, bool multiSampled) override;

    unsigned int GetWidth() const override;
    unsigned int GetHeight() const override;
    unsigned int GetDepth() const override { return 1; }
    HdFormat GetFormat() const override;
    bool IsMultiSampled() const override { return false; }

    /// Maps the newest image, unless the buffer is mapped already. Returns null if nothing is allocated. Each Map needs
    /// an Unmap, also then.
    void* Map() override;
    void Unmap() override;
    bool IsMapped() const override;

    void Resolve() override;

    /// Returns true once the final image is in this buffer, or if no pass has ever bound it. A mapped buffer keeps an
    /// older image until it is unmapped, and says false so long. One that passes have left waits for the session: a
    /// host asks between executions, when a buffer that was allocated anew is not bound again yet.
    bool IsConverged() const override;

protected:
    void _Deallocate() override;

private:
    /// Copies the newest image unless the buffer is mapped. Returns true if the buffer then holds the newest state.
    bool _CopyLatest() const;
    void const* _Viewport() const;
    /// Returns true if the session has no newer image than the buffer.
    bool _HoldsNewest() const;
    bool _IsBound() const;
    bool _ReadFrom(HdOocPTAov const& aov) const;
    /// Fits an image that the buffer shows to another size. False: it shows none, or its format is another one. The
    /// caller of this and of the next two holds the mutex.
    bool _StretchTo(size_t width, size_t height, HdFormat format);
    /// Gives the pixels up; mapped ones stay until they are unmapped.
    void _DropPixels();
    void _Clear();
    size_t _PixelCount() const { return static_cast<size_t>(_width) * _height; }

    std::shared_ptr<HdOocPTSession> const _session;

    mutable std::mutex _mutex;
    mutable std::vector<unsigned char> _pixels;
    mutable std::vector<unsigned char> _unconverted;
    mutable bool _holdsImage = false;
    /// It shows an image of another size, stretched.
    mutable bool _isStretched = false;
    /// It was filled with _clearValue since it was allocated; an image may have come since.
    bool _isFilled = false;
    VtValue _clearValue;
    /// The version of the image that it holds.
    mutable uint64_t _version = 0;
    HdOocPTAov const* _aov = nullptr;
    /// That of the pass that binds it.
    void const* _viewport = nullptr;
    bool _isBound = false;
    unsigned int _width = 0;
    unsigned int _height = 0;
    HdFormat _format = HdFormatInvalid;
    int _mapCount = 0;
    /// The host has a pointer to _pixels.
    bool _isHandedOut = false;
    /// Pixels of other sizes to which the host has pointers.
    std::vector<std::vector<unsigned char>> _stillMapped;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
