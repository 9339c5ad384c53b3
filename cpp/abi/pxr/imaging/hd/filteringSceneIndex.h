// SPDX-License-Identifier: Apache-2.0
/// Scene indices that read other scene indices. Declared for conversion only; the shim derives from none of them.
#ifndef OOCPT_ABI_HD_FILTERING_SCENE_INDEX_H
#define OOCPT_ABI_HD_FILTERING_SCENE_INDEX_H

#include "pxr/imaging/hd/sceneIndex.h"

#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

class HD_API HdFilteringSceneIndexBase : public HdSceneIndexBase
{
public:
    virtual std::vector<HdSceneIndexBaseRefPtr> GetInputScenes() const = 0;
};

/// One input. The slots after GetInputScenes belong to deriving classes and are not declared.
class HD_API HdSingleInputFilteringSceneIndexBase : public HdFilteringSceneIndexBase
{
protected:
    HdSingleInputFilteringSceneIndexBase() = delete;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
