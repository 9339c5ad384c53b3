// SPDX-License-Identifier: Apache-2.0
/// A scene as Hydra sees it: prims by path, each with a type and a data source.
#ifndef OOCPT_ABI_HD_SCENE_INDEX_H
#define OOCPT_ABI_HD_SCENE_INDEX_H

#include "pxr/base/tf/declarePtrs.h"
#include "pxr/base/tf/refBase.h"
#include "pxr/base/tf/refPtr.h"
#include "pxr/base/tf/token.h"
#include "pxr/base/tf/weakBase.h"
#include "pxr/base/tf/weakPtr.h"
#include "pxr/imaging/hd/api.h"
#include "pxr/imaging/hd/dataSource.h"
#include "pxr/imaging/hd/sceneIndexObserver.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

#include <string>

PXR_NAMESPACE_OPEN_SCOPE

/// What a scene index answers for one path. An absent prim has a null data source.
struct HdSceneIndexPrim
{
    TfToken primType;
    HdContainerDataSourceHandle dataSource;
};

TF_DECLARE_REF_PTRS(HdSceneIndexBase);

/// Reference-counted by TfRefPtr. GetPrim and GetChildPrimPaths may be called from several threads.
class HD_API HdSceneIndexBase : public TfRefBase, public TfWeakBase
{
public:
    ~HdSceneIndexBase() override;

    /// Observers are held weakly and are not told of prims that exist already.
    void AddObserver(HdSceneIndexObserverPtr const& observer);
    void RemoveObserver(HdSceneIndexObserverPtr const& observer);

    virtual HdSceneIndexPrim GetPrim(SdfPath const& primPath) const = 0;
    virtual SdfPathVector GetChildPrimPaths(SdfPath const& primPath) const = 0;

    std::string GetDisplayName() const;

protected:
    HdSceneIndexBase();

    virtual void _SystemMessage(TfToken const& messageType, HdDataSourceBaseHandle const& args);

private:
    unsigned char _opaque[0x60];
};

static_assert(sizeof(HdSceneIndexPrim) == 0x18);
static_assert(sizeof(HdSceneIndexBase) == 0x78);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
