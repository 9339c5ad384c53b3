// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_PRODUCT_READER_H
#define HDOOCPT_SCENE_PRODUCT_READER_H

#include "pxr/base/gf/matrix4d.h"
#include "pxr/base/gf/range2d.h"
#include "pxr/base/gf/vec2i.h"
#include "pxr/base/tf/token.h"
#include "pxr/imaging/hd/sceneIndex.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"
#include "scene/settingsReader.h"

#include <optional>
#include <set>
#include <string>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

/// A UsdRenderVar.
struct HdOocPTProductVar
{
    SdfPath path;
    TfToken dataType;
    std::string sourceName;
    TfToken sourceType;
    HdOocPTSettingMap settings;
};

/// A UsdRenderProduct, with what it takes over from its render settings.
struct HdOocPTProduct
{
    SdfPath path;
    TfToken type;
    std::string name;
    SdfPath camera;
    GfVec2i resolution { 0 };
    double pixelAspectRatio = 1.0;
    TfToken conformPolicy;
    /// 0 to 1 over the picture, y up.
    GfRange2d dataWindow { GfVec2d(0.0), GfVec2d(1.0) };
    bool isLensDisabled = false;
    /// The linear space in which colours are written; empty: the renderer's.
    TfToken colorSpace;
    std::vector<HdOocPTProductVar> vars;
    HdOocPTSettingMap settings;
};

/// The products of the active one of these render settings prims.
std::vector<HdOocPTProduct> HdOocPTReadProducts(const HdSceneIndexBase& scene, const std::set<SdfPath>& prims);

/// The current frame that the scene's globals name; none where the front end does not have it.
std::optional<double> HdOocPTReadCurrentFrame(const HdSceneIndexBase& scene);

/// What a camera prim sees: its place, and its projection to a picture of a product.
struct HdOocPTProductView
{
    GfMatrix4d viewToWorld { 1.0 };
    /// Of the picture, GL clip space; the product's policy for other aspect ratios is applied.
    GfMatrix4d projection { 1.0 };
    /// Width of a pixel over its height.
    double pixelAspectRatio = 1.0;
};

/// The view of a product's camera; none if there is no such camera.
std::optional<HdOocPTProductView> HdOocPTReadProductView(const HdSceneIndexBase& scene, const HdOocPTProduct& product);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
