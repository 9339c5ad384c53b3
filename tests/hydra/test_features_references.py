# SPDX-License-Identifier: Apache-2.0
"""Feature scenes without a closed form against Mitsuba's converged means that lie beside them (`cargo xtask reference`), both front ends."""

import json

import feature_references
import featured
import features
import numpy as np
import pytest

SCENES = ["reference_bounces", "reference_glass"]
"""Of feature_references.SCENES."""

MODEL = {"reference_metal": 8e-3}
"""What models may differ by, relative: light lost between microfacets, which Mitsuba's rough conductor does not give back."""


@pytest.mark.parametrize("name", SCENES)
def test_reference(host, name):
    reference = json.loads((features.FOLDER / f"{name}.json").read_text())
    mean, error = np.array(reference["mean"]), np.array(reference["error"])
    columns, rows = feature_references.BLOCKS
    width, height = feature_references.SIZE
    # A picture whose blocks have the reference's means.
    expected = np.repeat(np.repeat(mean, height // rows, axis=0), width // columns, axis=1)
    made = featured.pictures(host, name, (width, height), samples=128, bounces=reference["made"]["bounces"], seeds=6)
    featured.agree(made, expected, name, grid=(columns, rows), relative=MODEL.get(name, 2e-3), error=error, noise=1e-2)
