// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_IMAGES_IMAGE_KIND_H
#define HDOOCPT_IMAGES_IMAGE_KIND_H

#include "images/imageLibrary.h"

#include <string>

/// OpenImageIO's name of the format of a file, from its first bytes (Targa, which has no magic number, from its name).
/// Throws std::runtime_error for any other file: OpenImageIO itself would try some thirty readers on it, video and
/// medical formats included.
std::string HdOocPTFindImageFormat(const std::string& name, const HdOocPTImageBytes& bytes);

/// Returns 1 if a PNG says that it is sRGB, 0 if it says that it is linear, -1 if it says nothing. OpenImageIO calls
/// every PNG sRGB.
int HdOocPTFindPngColorSpace(const HdOocPTImageBytes& bytes);

#endif
