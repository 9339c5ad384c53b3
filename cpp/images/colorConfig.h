// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_IMAGES_COLOR_CONFIG_H
#define HDOOCPT_IMAGES_COLOR_CONFIG_H

#include <OpenColorIO/OpenColorIO.h>

/// The color spaces that are known without $OCIO: those of OpenUSD's GfColorSpaceNames and of the Color Interop Forum
/// ("Color Space Encodings for Texture Assets and CG Rendering", 2024), with the names that the ACES configurations
/// give to them. The reference is `lin_rec709`, linear Rec. 709 with the white of D65; other whites are adapted by
/// Bradford's matrix. Throws OCIO::Exception.
OCIO_NAMESPACE::ConstConfigRcPtr HdOocPTMakeColorConfig();

#endif
