// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_PATH_COLLECTION_H
#define HDOOCPT_SCENE_PATH_COLLECTION_H

#include "pxr/imaging/hd/dataSource.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"
#include "pxr/usd/sdf/pathExpression.h"
#include "pxr/usd/sdf/pathExpressionEval.h"
#include "scene/warnings.h"

#include <optional>
#include <string>

PXR_NAMESPACE_OPEN_SCOPE

/// The membership expression of a prim's collection; none if the prim has no such collection. Safe on any thread.
std::optional<SdfPathExpression> HdOocPTReadMembership(const HdContainerDataSourceHandle& prim, const TfToken& name);

/// A collection whose members an expression over paths tells. Predicates, which test more than paths, are not
/// supported.
///
/// Threads: Holds() from several at once.
class HdOocPTPathCollection
{
public:
    /// Compiles the expression of a prim's collection. None if it cannot be used, with a warning at the prim that ends
    /// with what then becomes of it.
    static std::optional<HdOocPTPathCollection> Compile(const SdfPath& prim, const TfToken& name,
        const SdfPathExpression& expression, const std::string& otherwise, HdOocPTWarnings* warnings);

    /// Returns true if the collection holds the path.
    bool Holds(const SdfPath& path) const;

    /// Collections of one expression hold the same paths.
    bool operator==(const HdOocPTPathCollection& other) const { return _expression == other._expression; }

private:
    using _Eval = SdfPathExpressionEval<const SdfPath&>;

    HdOocPTPathCollection(const SdfPathExpression& expression, _Eval&& eval);

    SdfPathExpression _expression;
    _Eval _eval;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
