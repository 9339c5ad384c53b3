// SPDX-License-Identifier: Apache-2.0
#include "scene/pathCollection.h"

#include "pxr/base/tf/errorMark.h"
#include "pxr/base/vt/value.h"
#include "pxr/usd/sdf/predicateLibrary.h"
#include "scene/dataSource.h"
#include "scene/tokens.h"

#include <utility>

PXR_NAMESPACE_OPEN_SCOPE

std::optional<SdfPathExpression> HdOocPTReadMembership(const HdContainerDataSourceHandle& prim, const TfToken& name)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const VtValue value = HdOocPTRead(prim, { tokens.collections, name, tokens.membershipExpression });
    return value.IsHolding<SdfPathExpression>() ? std::make_optional(value.UncheckedGet<SdfPathExpression>())
                                                : std::nullopt;
}

HdOocPTPathCollection::HdOocPTPathCollection(const SdfPathExpression& expression, _Eval&& eval)
    : _expression(expression)
    , _eval(std::move(eval))
{
}

std::optional<HdOocPTPathCollection> HdOocPTPathCollection::Compile(const SdfPath& prim, const TfToken& name,
    const SdfPathExpression& expression, const std::string& otherwise, HdOocPTWarnings* warnings)
{
    // Without a library of predicates, expressions that use them do not compile.
    TfErrorMark mark;
    _Eval eval = SdfMakePathExpressionEval(expression, SdfPredicateLibrary<const SdfPath&>());
    const bool isUsable = mark.IsClean() && expression.IsComplete() && (eval || expression.IsEmpty());
    mark.Clear();
    if (!isUsable) {
        warnings->Add(prim,
            "its collection " + name.GetString() + " uses more than paths (" + expression.GetText()
                + "), which is not supported yet; " + otherwise);
        return std::nullopt;
    }
    return HdOocPTPathCollection(expression, std::move(eval));
}

bool HdOocPTPathCollection::Holds(const SdfPath& path) const
{
    return static_cast<bool>(_eval.Match(path, [](const SdfPath& tested) -> const SdfPath& { return tested; }));
}

PXR_NAMESPACE_CLOSE_SCOPE
