# SPDX-License-Identifier: Apache-2.0
"""Small files that were once rendered wrongly, in both front ends, against values derived in closed form.

The scenes are `tests/scenes/cases/*.usda`: cells of one unit in the plane z = 0 under the orthographic camera `/Cam`.
Each module of the folder `cases` is one subject; its `CASES` say what every cell must show, and why (cases/case.py).
"""

from __future__ import annotations

import numpy as np
import pytest
from cases import ALL
from cases.case import FOLDER, Case

pytestmark = pytest.mark.both_front_ends


@pytest.mark.parametrize("case", ALL, ids=[case.name for case in ALL])
def test_case_matches_its_derivation(host, case: Case):
    """Every cell has the value that its derivation gives."""
    if case.front_end not in ("", "scene_index" if host.scene_index else "legacy"):
        pytest.skip(f"for the front end {case.front_end}")
    made = case.render(host)
    wrong = case.compare(made, host.scene_index)
    assert not wrong, f"{case.name}: {case.why}\n" + "\n".join(wrong)


def test_every_scene_has_an_answer():
    """No file lies in the folder that nothing looks at."""
    assert {path.stem for path in FOLDER.glob("*.usda")} == {case.file for case in ALL}


def test_the_comparison_sees_a_wrong_cell():
    """A planted fault: one cell that is 10 % off, and one that is not finite."""
    case = Case("planted", (2, 1), {(0, 0): 0.5, (1, 0): 0.25}, "planted")
    right = np.zeros((case.pixels, 2 * case.pixels, 3))
    right[:, : case.pixels], right[:, case.pixels :] = 0.5, 0.25
    assert case.compare(right) == []
    for value in (0.275, np.nan):
        wrong = right.copy()
        wrong[:, case.pixels :] = value
        assert len(case.compare(wrong)) == 1, value
