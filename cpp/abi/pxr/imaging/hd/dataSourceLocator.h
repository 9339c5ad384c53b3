// SPDX-License-Identifier: Apache-2.0
/// Paths of names inside a prim's data source, and sets of them as carried by dirty notices.
#ifndef OOCPT_ABI_HD_DATA_SOURCE_LOCATOR_H
#define OOCPT_ABI_HD_DATA_SOURCE_LOCATOR_H

#include "pxr/base/tf/smallVector.h"
#include "pxr/base/tf/token.h"
#include "pxr/imaging/hd/api.h"
#include "pxr/pxr.h"

#include <cstddef>
#include <initializer_list>
#include <string>

PXR_NAMESPACE_OPEN_SCOPE

/// One path of names. Plain value.
class HdDataSourceLocator
{
public:
    HD_API static HdDataSourceLocator const& EmptyLocator();

    HD_API HdDataSourceLocator();
    HD_API explicit HdDataSourceLocator(TfToken const& t1);
    HD_API HdDataSourceLocator(TfToken const& t1, TfToken const& t2);
    HD_API HdDataSourceLocator(TfToken const& t1, TfToken const& t2, TfToken const& t3);
    HD_API HdDataSourceLocator(std::size_t count, TfToken const* tokens);

    bool IsEmpty() const { return _tokens.empty(); }
    HD_API std::size_t GetElementCount() const;
    HD_API TfToken const& GetElement(std::size_t i) const;
    HD_API TfToken const& GetFirstElement() const;
    HD_API TfToken const& GetLastElement() const;
    HD_API HdDataSourceLocator Append(TfToken const& name) const;
    HD_API bool HasPrefix(HdDataSourceLocator const& prefix) const;

    /// True when one of the two is a prefix of the other.
    HD_API bool Intersects(HdDataSourceLocator const& other) const;
    HD_API std::string GetString(char const* delimiter = "/") const;

    HD_API bool operator<(HdDataSourceLocator const& rhs) const;
    bool operator==(HdDataSourceLocator const& rhs) const { return _tokens == rhs._tokens; }
    bool operator!=(HdDataSourceLocator const& rhs) const { return !(*this == rhs); }

private:
    TfSmallVector<TfToken, 6> _tokens;
};

/// A sorted set of locators closed under "has as prefix".
class HdDataSourceLocatorSet
{
    using _Locators = TfSmallVector<HdDataSourceLocator, 8>;

public:
    using const_iterator = HdDataSourceLocator const*;

    HdDataSourceLocatorSet() = default;
    HD_API HdDataSourceLocatorSet(HdDataSourceLocator const& locator);
    HD_API HdDataSourceLocatorSet(std::initializer_list<HdDataSourceLocator const> const& locators);

    HD_API static HdDataSourceLocatorSet const& UniversalSet();

    HD_API void insert(HdDataSourceLocator const& locator);
    HD_API void insert(HdDataSourceLocatorSet const& locators);

    HD_API bool Intersects(HdDataSourceLocator const& locator) const;
    HD_API bool Intersects(HdDataSourceLocatorSet const& locators) const;

    /// True when the set holds `locator` or a prefix of it.
    HD_API bool Contains(HdDataSourceLocator const& locator) const;
    HD_API bool IsEmpty() const;
    HD_API const_iterator begin() const;
    HD_API const_iterator end() const;

private:
    _Locators _locators;
};

static_assert(sizeof(HdDataSourceLocator) == 0x38);
static_assert(sizeof(HdDataSourceLocatorSet) == 0x1c8);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
