// SPDX-License-Identifier: Apache-2.0
/// Small types shared by Hydra's interfaces: dirty bits and pixel formats.
#ifndef OOCPT_ABI_HD_TYPES_H
#define OOCPT_ABI_HD_TYPES_H

#include "pxr/imaging/hd/api.h"
#include "pxr/pxr.h"

#include <cstddef>
#include <cstdint>

PXR_NAMESPACE_OPEN_SCOPE

using HdDirtyBits = uint32_t;

/// Memory format of one pixel; the ABI check compares every value with HdDataSizeOfFormat.
enum HdFormat
{
    HdFormatInvalid = -1,
    HdFormatUNorm8 = 0,
    HdFormatUNorm8Vec2 = 1,
    HdFormatUNorm8Vec3 = 2,
    HdFormatUNorm8Vec4 = 3,
    HdFormatSNorm8 = 4,
    HdFormatSNorm8Vec2 = 5,
    HdFormatSNorm8Vec3 = 6,
    HdFormatSNorm8Vec4 = 7,
    HdFormatFloat16 = 8,
    HdFormatFloat16Vec2 = 9,
    HdFormatFloat16Vec3 = 10,
    HdFormatFloat16Vec4 = 11,
    HdFormatFloat32 = 12,
    HdFormatFloat32Vec2 = 13,
    HdFormatFloat32Vec3 = 14,
    HdFormatFloat32Vec4 = 15,
    HdFormatInt16 = 16,
    HdFormatUInt16 = 20,
    HdFormatInt32 = 24,
    HdFormatInt32Vec4 = 27,
    HdFormatFloat32UInt8 = 28,
    HdFormatCount = 29
};

HD_API HdFormat HdGetComponentFormat(HdFormat format);
HD_API std::size_t HdGetComponentCount(HdFormat format);
HD_API std::size_t HdDataSizeOfFormat(HdFormat format);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
