// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_LIGHT_READER_H
#define HDOOCPT_SCENE_LIGHT_READER_H

#include "pxr/base/tf/token.h"
#include "pxr/pxr.h"
#include "scene/primReader.h"

namespace oocpt {
struct LightDesc;
}

PXR_NAMESPACE_OPEN_SCOPE

/// Reads a light whole; simple lights (a host's camera light) are distant lights. What is not supported is named in a warning
/// and left out.
oocpt::LightDesc HdOocPTReadLight(const HdOocPTPrimSource& source, const TfToken& type);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
