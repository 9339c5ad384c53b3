# SPDX-License-Identifier: Apache-2.0
"""OocPT, a path tracer for USD's Hydra on Vulkan GPUs, as a Python package.

    >>> import oocpt
    >>> picture = oocpt.render("scene.usda", camera="/World/Camera", samples=64)
    >>> picture["color"].shape
    (540, 960, 4)

`render` gives arrays, `usdrecord` writes files; both are what `oocpt record` does on a command line. The renderer runs
in a process of its own, with the OpenUSD of the package `bpy`: an OpenUSD that is imported here does not get into it.
"""

from oocpt._host import RenderError
from oocpt._picture import Picture
from oocpt._render import render, usdrecord

__all__ = ["Picture", "RenderError", "render", "usdrecord"]
