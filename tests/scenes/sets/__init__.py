# SPDX-License-Identifier: Apache-2.0
"""Sets as people build them, for measuring: many files, real textures, references, nested instances.

    python -m sets.reef FOLDER [--seed N] [--size S] [--texture N]       (from tests/scenes; needs pxr and numpy)
    python -m sets.city ...    python -m sets.interior ...    python -m sets.grove ...

Each writes FOLDER/NAME.usda and what that needs. `--size 1` is a set for a GPU; 0.05 is one to look at. Same arguments,
same files.

**Even seeds are for tuning. Odd seeds are held out: nobody renders them while a change is made that they may judge.
Figures that are published are those of odd seeds.**
"""

NAMES = ("reef", "city", "interior", "grove")
