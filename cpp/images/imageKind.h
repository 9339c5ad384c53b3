// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_IMAGES_IMAGE_KIND_H
#define HDOOCPT_IMAGES_IMAGE_KIND_H

#include "images/imageLibrary.h"

#include <string>

/// OpenImageIO's name of the format of a file, told from its first bytes (Targa, which has no mark, from its name).
/// Throws std::runtime_error for any other file: OpenImageIO itself would try some thirty readers on it, video and
/// medicine included.
std::string HdOocPTFindImageFormat(const std::string& name, const HdOocPTImageBytes& bytes);

/// Whether a PNG says that it is sRGB (1) or linear (0); -1 when it says nothing. OpenImageIO calls every PNG sRGB.
int HdOocPTFindPngColorSpace(const HdOocPTImageBytes& bytes);

#endif
