// SPDX-License-Identifier: Apache-2.0
/// Version and namespace of the wheel host: OpenUSD 25.08 as bundled by its Python wheel.
///
/// The wheels of headers name the namespace pxrInternal_v0_25_8__pxrReserved__; the build maps that name to the
/// runtime's own with one -D flag. This folder holds interface declarations only, written from the runtime binary.
#ifndef OOCPT_ABI_PXR_H
#define OOCPT_ABI_PXR_H

#define PXR_MAJOR_VERSION 0
#define PXR_MINOR_VERSION 25
#define PXR_PATCH_VERSION 8
#define PXR_VERSION 2508

#define PXR_NS pxr
#define PXR_INTERNAL_NS pxrInternal_v0_25_8__pxrReserved__
#define PXR_NS_GLOBAL ::PXR_NS

namespace PXR_INTERNAL_NS {
}

namespace PXR_NS {
using namespace PXR_INTERNAL_NS;
}

#define PXR_NAMESPACE_OPEN_SCOPE namespace PXR_INTERNAL_NS {
#define PXR_NAMESPACE_CLOSE_SCOPE }
#define PXR_NAMESPACE_USING_DIRECTIVE using namespace PXR_NS;

/// Tells translation units that the imaging declarations are ours, not an SDK's.
#define OOCPT_ABI_HEADERS 1

#endif
