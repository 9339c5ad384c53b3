// SPDX-License-Identifier: Apache-2.0
/// One kind of drawing over a collection of prims.
#ifndef OOCPT_ABI_HD_RENDER_PASS_H
#define OOCPT_ABI_HD_RENDER_PASS_H

#include "pxr/base/tf/token.h"
#include "pxr/imaging/hd/api.h"
#include "pxr/imaging/hd/renderPassState.h"
#include "pxr/imaging/hd/rprimCollection.h"
#include "pxr/pxr.h"

#include <memory>

PXR_NAMESPACE_OPEN_SCOPE

class HdRenderIndex;

class HD_API HdRenderPass
{
public:
    HdRenderPass(HdRenderIndex* index, HdRprimCollection const& collection);
    virtual ~HdRenderPass();

    HdRenderIndex* GetRenderIndex() const { return _renderIndex; }

    void Execute(HdRenderPassStateSharedPtr const& renderPassState, TfTokenVector const& renderTags);
    virtual bool IsConverged() const;

protected:
    virtual void _Execute(HdRenderPassStateSharedPtr const& renderPassState, TfTokenVector const& renderTags) = 0;
    virtual void _MarkCollectionDirty();
    virtual void _Sync();

private:
    HdRenderIndex* _renderIndex;
    unsigned char _opaque[0x68];
};

using HdRenderPassSharedPtr = std::shared_ptr<HdRenderPass>;

static_assert(sizeof(HdRenderPass) == 0x78);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
