# SPDX-License-Identifier: Apache-2.0
"""Feature scenes without a closed form against Mitsuba's converged means that lie beside them (`cargo xtask
reference`), both front ends."""

import json

import feature_references
import featured
import features
import numpy as np
import pytest

SCENES = [scene.__name__ for scene in feature_references.SCENES]


@pytest.mark.parametrize("name", SCENES)
def test_scene_matches_its_mitsuba_reference(host, name):
    reference = json.loads((features.FOLDER / f"{name}.json").read_text())
    mean, error = np.array(reference["mean"]), np.array(reference["error"])
    columns, rows = feature_references.BLOCKS
    width, height = feature_references.SIZE
    # A picture whose blocks have the reference's means.
    expected = np.repeat(np.repeat(mean, height // rows, axis=0), width // columns, axis=1)
    made = featured.pictures(host, name, (width, height), samples=128, bounces=reference["made"]["bounces"], seeds=6)
    featured.agree(made, expected, name, grid=(columns, rows), relative=2e-3, error=error, noise=1e-2)
