# SPDX-License-Identifier: Apache-2.0
"""The passes, a row each: which of a view layer's switches asks for it, its name, its channels, Hydra's image.

Blender's engine takes images of floats with as many channels as the pass has. So identities, which are whole numbers,
are asked for as floats, and `motion`, which has three channels and no shutter to open, fills no Vector pass.
"""

import dataclasses

import numpy

# What Blender's own engines put where nothing is seen.
NO_DEPTH = 1e10


@dataclasses.dataclass(frozen=True)
class RenderPass:
    """A pass: `switch` is a property of the view layer, or of its `oocpt` if `is_ours`."""

    switch: str
    name: str
    channels: str
    kind: str
    image: str
    is_ours: bool = False
    label: str = ""
    help: str = ""

    def is_wanted(self, view_layer):
        return getattr(view_layer.oocpt if self.is_ours else view_layer, self.switch)


PASSES = (
    RenderPass("use_pass_combined", "Combined", "RGBA", "COLOR", "color"),
    RenderPass("use_pass_z", "Depth", "Z", "VALUE", "cameraDepth"),
    RenderPass("use_pass_position", "Position", "XYZ", "VECTOR", "position"),
    RenderPass("use_pass_normal", "Normal", "XYZ", "VECTOR", "normal"),
    RenderPass("use_albedo", "Albedo", "RGB", "COLOR", "albedo", True, "Albedo", "Diffuse albedo of the first surface"),
    RenderPass("use_geometric_normal", "Geometric Normal", "XYZ", "VECTOR", "Ng", True, "Geometric Normal",
               "Normal of the surface as it is traced, without interpolation and normal maps"),
    RenderPass("use_prim_id", "Prim ID", "X", "VALUE", "primIdFloat", True, "Prim ID",
               "A number for each object in this picture, -1 where nothing is seen"),
    RenderPass("use_instance_id", "Instance ID", "X", "VALUE", "instanceIdFloat", True, "Instance ID",
               "A number for each instance of an object, -1 where nothing is seen"),
    RenderPass("use_sample_count", "Sample Count", "X", "VALUE", "sampleCount", True, "Sample Count",
               "Samples that the pixel took"),
    RenderPass("use_error", "Error", "X", "VALUE", "error", True, "Error",
               "Estimated standard error of the pixel relative to its value"),
    RenderPass("use_variance", "Variance", "RGB", "COLOR", "variance", True, "Variance",
               "Variance of the pixel's samples"),
    RenderPass("use_denoised", "Denoised", "RGBA", "COLOR", "denoised", True, "Denoised",
               "The picture, denoised by Open Image Denoise, beside the picture as it is"),
)  # fmt: skip
OURS = [one for one in PASSES if one.is_ours]


def wanted(view_layer):
    return [one for one in PASSES if one.is_wanted(view_layer)]


def put_far_what_is_not_seen(depth_pass, pixel_count):
    """A depth of 0 means that nothing is seen, which Blender's compositor takes for the nearest there is."""
    depth = numpy.empty(pixel_count, dtype=numpy.float32)
    depth_pass.rect.foreach_get(depth)
    depth[depth == 0] = NO_DEPTH
    depth_pass.rect.foreach_set(depth)
