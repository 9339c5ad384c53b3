// SPDX-License-Identifier: Apache-2.0
#include "scene/sceneChain.h"

#include "pxr/base/tf/staticTokens.h"
#include "pxr/imaging/hd/dataSource.h"
#include "pxr/imaging/hdsi/extComputationPrimvarPruningSceneIndex.h"
#include "pxr/imaging/hdsi/implicitSurfaceSceneIndex.h"
#include "pxr/imaging/hdsi/nurbsApproximatingSceneIndex.h"
#include "pxr/imaging/hdsi/tetMeshConversionSceneIndex.h"

#include <memory>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

TF_DEFINE_PRIVATE_TOKENS(_shapeTokens, (toMesh)(cube)(plane));

namespace {

/// One token that never changes.
class _TokenDataSource final : public HdTypedSampledDataSource<TfToken>
{
public:
    explicit _TokenDataSource(const TfToken& token)
        : _token(token)
    {
    }

    VtValue GetValue(Time) override { return VtValue(_token); }
    TfToken GetTypedValue(Time) override { return _token; }
    bool GetContributingSampleTimesForInterval(Time, Time, std::vector<Time>*) override { return false; }

private:
    const TfToken _token;
};

/// Arguments of the implicit surface scene index: it makes a mesh of every kind of shape but solids of revolution,
/// which scene/shapeReader.h reads.
class _OtherShapesToMesh final : public HdContainerDataSource
{
public:
    TfTokenVector GetNames() override { return { _shapeTokens->cube, _shapeTokens->plane }; }

    HdDataSourceBaseHandle Get(const TfToken& name) override
    {
        for (const TfToken& known : GetNames()) {
            if (name == known) {
                return std::make_shared<_TokenDataSource>(_shapeTokens->toMesh);
            }
        }
        return nullptr;
    }
};

} // namespace

HdSceneIndexBaseRefPtr HdOocPTChainSceneIndices(const HdSceneIndexBaseRefPtr& terminal)
{
    const HdSceneIndexBaseRefPtr computed = HdSiExtComputationPrimvarPruningSceneIndex::New(terminal);
    const HdSceneIndexBaseRefPtr shapes
        = HdsiImplicitSurfaceSceneIndex::New(computed, std::make_shared<_OtherShapesToMesh>());
    const HdSceneIndexBaseRefPtr curves = HdsiNurbsApproximatingSceneIndex::New(shapes);
    return HdsiTetMeshConversionSceneIndex::New(curves);
}

PXR_NAMESPACE_CLOSE_SCOPE
