// SPDX-License-Identifier: Apache-2.0
/// How the camera's image is placed in the render buffers.
#ifndef OOCPT_ABI_CAMERA_UTIL_FRAMING_H
#define OOCPT_ABI_CAMERA_UTIL_FRAMING_H

#include "pxr/base/gf/range2f.h"
#include "pxr/base/gf/rect2i.h"
#include "pxr/imaging/hd/api.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// Both windows are in pixels with y down; the data window's maximum is inclusive.
class CameraUtilFraming
{
public:
    HD_API CameraUtilFraming();

    HD_API bool IsValid() const;

    GfRange2f displayWindow;
    GfRect2i dataWindow;
    float pixelAspectRatio;
};

static_assert(sizeof(CameraUtilFraming) == 0x24);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
