// SPDX-License-Identifier: Apache-2.0
/// The only place where the shim asks which OpenUSD it is compiled for.
///
/// Compiled and run: 25.08 (wheel host, declarations under cpp/abi/25.08) and 24.11 (SDK headers).
#ifndef HDOOCPT_COMPAT_H
#define HDOOCPT_COMPAT_H

#include "pxr/pxr.h"

#if PXR_VERSION < 2411
#error "hdOocPT needs OpenUSD 24.11 or newer: HdRenderDelegate::SetTerminalSceneIndex is how it reads the scene"
#endif

#if defined(OOCPT_ABI_HEADERS) && PXR_VERSION != 2508
#error "cpp/abi/25.08 describes one runtime only; build against the headers of your own OpenUSD instead"
#endif

#endif
