# SPDX-License-Identifier: Apache-2.0
"""Point instancers whose instances come and go over time, and prototypes that nobody shows."""

from cases.case import Case

R, G, SKY = (1, 0, 0), (0, 1, 0), (1, 1, 1)


def _rows(rows, why, **more):
    cells = {(x, y): value for y, row in enumerate(rows) for x, value in enumerate(row)}
    return Case("08_instancer_time", (4, 9), cells, why, **{"bounces": 0, "inset": 0.25, "samples": 16, **more})


_WHY = (
    "a sky of 1, which surfaces reflect in their colour, from the bottom: ids that are hidden, changing counts,"
    " changing prototypes, an instancer that is hidden, a hidden id without ids, an inactive id, a prototype that is"
    " moved and one that is hidden, half a turn, a mirrored one"
)
_STILL = (
    (R, SKY, R, SKY),
    (R, G, SKY, SKY),
    (SKY, R, SKY, R),
    (R, SKY, SKY, SKY),
    (R, G, SKY, SKY),
)
_FIRST = ((SKY, G, R, SKY), (SKY, SKY, SKY, SKY), (R, R, R, SKY), (SKY, SKY, SKY, SKY), *_STILL)
_THIRD = ((R, G, R, SKY), (G, G, G, SKY), (G, G, G, SKY), (R, G, R, SKY), *_STILL)

CASES = [
    # The old front end's host itself warns of prototypes that nobody shows.
    _rows(_FIRST, _WHY, edit="view.params.frame = Usd.TimeCode(1)", front_end="legacy", variant="legacy"),
    _rows(_FIRST, _WHY, edit="view.params.frame = Usd.TimeCode(1)", front_end="scene_index", silent=True),
    _rows(
        _THIRD, _WHY, edit="view.params.frame = Usd.TimeCode(1)", later="view.params.frame = Usd.TimeCode(3)",
        variant="later",
    ),
]
