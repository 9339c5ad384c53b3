// SPDX-License-Identifier: Apache-2.0
//! Materials: networks of `UsdPreviewSurface` and `MaterialX`, their description as text, hostile networks.

mod describe;
mod hostile;
mod materialx;
pub(crate) mod preview_surface;
