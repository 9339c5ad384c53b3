// SPDX-License-Identifier: Apache-2.0
// A table of the first vertex at each site. Used by one thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace oocpt::subdiv {

/// The first vertex of each site that faces share.
class SiteTable
{
public:
    /// No vertex, no place.
    static constexpr int32_t none = -1;

    /// Makes a table of at most so many sites.
    explicit SiteTable(size_t count)
    {
        size_t size = 16;
        while (size < 2 * count) {
            size *= 2;
        }
        _slots.assign(size, { none, none });
    }

    /// The vertex of a site; `none` if there is none yet.
    int32_t& operator[](int32_t site)
    {
        const size_t mask = _slots.size() - 1;
        size_t at = static_cast<size_t>(site) * 0x9E3779B97F4A7C15ULL >> 20U & mask;
        while (_slots[at].site != site && _slots[at].site != none) {
            at = (at + 1) & mask;
        }
        _slots[at].site = site;
        return _slots[at].vertex;
    }

private:
    struct _Slot
    {
        int32_t site;
        int32_t vertex;
    };
    std::vector<_Slot> _slots;
};

} // namespace oocpt::subdiv
