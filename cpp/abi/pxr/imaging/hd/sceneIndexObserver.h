// SPDX-License-Identifier: Apache-2.0
/// Receiver of a scene index's change notices.
#ifndef OOCPT_ABI_HD_SCENE_INDEX_OBSERVER_H
#define OOCPT_ABI_HD_SCENE_INDEX_OBSERVER_H

#include "pxr/base/tf/smallVector.h"
#include "pxr/base/tf/token.h"
#include "pxr/base/tf/weakBase.h"
#include "pxr/base/tf/weakPtr.h"
#include "pxr/imaging/hd/api.h"
#include "pxr/imaging/hd/dataSourceLocator.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

PXR_NAMESPACE_OPEN_SCOPE

class HdSceneIndexBase;

/// Notices arrive on the thread that changes the scene, in the middle of the change: record, read later.
class HD_API HdSceneIndexObserver : public TfWeakBase
{
public:
    struct AddedPrimEntry
    {
        AddedPrimEntry(SdfPath const& path, TfToken const& type)
            : primPath(path)
            , primType(type)
        {
        }

        SdfPath primPath;
        TfToken primType;
    };

    struct RemovedPrimEntry
    {
        RemovedPrimEntry(SdfPath const& path)
            : primPath(path)
        {
        }

        SdfPath primPath;
    };

    struct DirtiedPrimEntry
    {
        DirtiedPrimEntry(SdfPath const& path, HdDataSourceLocatorSet const& locators)
            : primPath(path)
            , dirtyLocators(locators)
        {
        }

        SdfPath primPath;
        HdDataSourceLocatorSet dirtyLocators;
    };

    struct RenamedPrimEntry
    {
        RenamedPrimEntry(SdfPath const& oldPath, SdfPath const& newPath)
            : oldPrimPath(oldPath)
            , newPrimPath(newPath)
        {
        }

        SdfPath oldPrimPath;
        SdfPath newPrimPath;
    };

    using AddedPrimEntries = TfSmallVector<AddedPrimEntry, 16>;
    using RemovedPrimEntries = TfSmallVector<RemovedPrimEntry, 16>;
    using DirtiedPrimEntries = TfSmallVector<DirtiedPrimEntry, 16>;
    using RenamedPrimEntries = TfSmallVector<RenamedPrimEntry, 16>;

    virtual ~HdSceneIndexObserver() = 0;

    virtual void PrimsAdded(HdSceneIndexBase const& sender, AddedPrimEntries const& entries) = 0;
    virtual void PrimsRemoved(HdSceneIndexBase const& sender, RemovedPrimEntries const& entries) = 0;
    virtual void PrimsDirtied(HdSceneIndexBase const& sender, DirtiedPrimEntries const& entries) = 0;
    virtual void PrimsRenamed(HdSceneIndexBase const& sender, RenamedPrimEntries const& entries) = 0;

    /// Replays a rename as a removal and additions on `observer`.
    static void ConvertPrimsRenamedToRemovedAndAdded(
        HdSceneIndexBase const& sender, RenamedPrimEntries const& entries, HdSceneIndexObserver* observer);
};

using HdSceneIndexObserverPtr = TfWeakPtr<HdSceneIndexObserver>;

static_assert(sizeof(HdSceneIndexObserver) == 0x10);
static_assert(sizeof(HdSceneIndexObserver::AddedPrimEntry) == 0x10);
static_assert(sizeof(HdSceneIndexObserver::RemovedPrimEntry) == 0x8);
static_assert(sizeof(HdSceneIndexObserver::DirtiedPrimEntry) == 0x1d0);
static_assert(sizeof(HdSceneIndexObserver::AddedPrimEntries) == 0x108);
static_assert(sizeof(HdSceneIndexObserver::RemovedPrimEntries) == 0x88);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
