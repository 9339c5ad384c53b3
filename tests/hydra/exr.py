# SPDX-License-Identifier: Apache-2.0
"""Reads EXR files written by the host."""

import numpy as np
import OpenEXR


def read(path, dtype=np.float32) -> np.ndarray:
    """(height, width, 4) RGBA, row 0 at the bottom as in Hydra's buffers; grey or RGB files get alpha 1."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = {name: channel.pixels for name, channel in file.channels().items()}
    alpha = channels.get("A", np.ones_like(channels["R"]))
    return np.stack([channels["R"], channels["G"], channels["B"], alpha], axis=-1)[::-1].astype(dtype)
