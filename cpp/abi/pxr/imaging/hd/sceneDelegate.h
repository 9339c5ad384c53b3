// SPDX-License-Identifier: Apache-2.0
/// A host's scene as legacy front ends hold it. The shim is handed some and makes none; of the functions behind those
/// that it calls nothing is declared.
#ifndef OOCPT_ABI_HD_SCENE_DELEGATE_H
#define OOCPT_ABI_HD_SCENE_DELEGATE_H

#include "pxr/base/gf/matrix4d.h"
#include "pxr/base/gf/range3d.h"
#include "pxr/base/tf/token.h"
#include "pxr/base/vt/array.h"
#include "pxr/base/vt/value.h"
#include "pxr/imaging/hd/api.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

PXR_NAMESPACE_OPEN_SCOPE

class HdBasisCurvesTopology;
class HdMeshTopology;
class HdRenderIndex;
class PxOsdSubdivTags;
struct HdDisplayStyle;
struct HdSyncRequestVector;

class HD_API HdSceneDelegate
{
public:
    HdSceneDelegate(HdRenderIndex* parentIndex, SdfPath const& delegateID);
    virtual ~HdSceneDelegate();

    virtual void Sync(HdSyncRequestVector* request);
    virtual void PostSyncCleanup();
    virtual bool IsEnabled(TfToken const& option) const;
    virtual HdMeshTopology GetMeshTopology(SdfPath const& id);
    virtual HdBasisCurvesTopology GetBasisCurvesTopology(SdfPath const& id);
    virtual PxOsdSubdivTags GetSubdivTags(SdfPath const& id);
    virtual GfRange3d GetExtent(SdfPath const& id);
    virtual GfMatrix4d GetTransform(SdfPath const& id);
    virtual bool GetVisible(SdfPath const& id);
    virtual bool GetDoubleSided(SdfPath const& id);
    virtual int GetCullStyle(SdfPath const& id);
    virtual VtValue GetShadingStyle(SdfPath const& id);
    virtual HdDisplayStyle GetDisplayStyle(SdfPath const& id);

    /// A value of a prim by name; empty where there is none. Called from worker threads while Hydra syncs.
    virtual VtValue Get(SdfPath const& id, TfToken const& key);
    /// The same with the indices of a primvar, whose values then are those that are indexed.
    virtual VtValue GetIndexedPrimvar(SdfPath const& id, TfToken const& key, VtArray<int>* outIndices);

private:
    unsigned char _opaque[0x10];
};

static_assert(sizeof(HdSceneDelegate) == 0x18);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
