// SPDX-License-Identifier: Apache-2.0
/// Pixels of one output.
#ifndef OOCPT_ABI_HD_RENDER_BUFFER_H
#define OOCPT_ABI_HD_RENDER_BUFFER_H

#include "pxr/base/gf/vec3i.h"
#include "pxr/base/vt/value.h"
#include "pxr/imaging/hd/bprim.h"

PXR_NAMESPACE_OPEN_SCOPE

class HD_API HdRenderBuffer : public HdBprim
{
public:
    explicit HdRenderBuffer(SdfPath const& id);
    ~HdRenderBuffer() override;

    /// Reads the descriptor from the scene and calls Allocate when it changed.
    void Sync(HdSceneDelegate* delegate, HdRenderParam* renderParam, HdDirtyBits* dirtyBits) override;
    void Finalize(HdRenderParam* renderParam) override;
    HdDirtyBits GetInitialDirtyBitsMask() const override;

    virtual bool Allocate(GfVec3i const& dimensions, HdFormat format, bool multiSampled) = 0;
    virtual unsigned int GetWidth() const = 0;
    virtual unsigned int GetHeight() const = 0;
    virtual unsigned int GetDepth() const = 0;
    virtual HdFormat GetFormat() const = 0;
    virtual bool IsMultiSampled() const = 0;
    virtual void* Map() = 0;
    virtual void Unmap() = 0;
    virtual bool IsMapped() const = 0;
    virtual void Resolve() = 0;
    virtual bool IsConverged() const = 0;
    virtual VtValue GetResource(bool multiSampled) const;

protected:
    virtual void _Deallocate() = 0;
};

static_assert(sizeof(HdRenderBuffer) == 0x10);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
