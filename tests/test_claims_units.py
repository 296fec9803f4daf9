"""Every number in a table of verdicts has a unit, and a difference or a ratio its direction."""

from collections.abc import Iterator

import pytest
from test_claims_falsifiable import PAGES, cases
from test_obstacles_page import results as obstacles_results  # noqa: F401 a fixture

from dissertation.evidence.claims import Claim

CARRY_A_UNIT = ("percent", "share", "count")
DIRECTIONS = {
    "more",
    "less",
    "fewer",
    "higher",
    "lower",
    "later",
    "earlier",
    "longer",
    "shorter",
    "nearer",
    "closer",
    "inside",
}


def values(given: object) -> list[object]:
    """The bound or test of a claim, or those of its cases."""
    return list(given.values()) if isinstance(given, dict) else [given]


def lacking(claim: Claim, unit: str) -> Iterator[str]:
    """What a claim's cells do not say in this unit. Differences are held against 0, ratios against 1."""
    ordered = set(values(claim.test)) <= {"above", "below"}
    bounds = values(claim.bound)
    if not unit:
        yield "a unit"
    elif (
        ordered
        and bounds == [0.0]
        and not unit.startswith("correlation")
        and not DIRECTIONS & set(unit.split())
    ):
        yield "the direction of a difference, as in `ms less`"
    elif ordered and bounds == [1.0] and not unit.startswith(("times ", "of the ", "%")):
        yield "what it is a multiple of, as in `times the NMSE`"


@pytest.mark.parametrize("page", PAGES)
def test_every_cell_has_a_unit_and_a_direction(page, request):
    its = PAGES[page]
    found = its.evidence(its.results(request.getfixturevalue)[0])
    missing = {
        (claim.evidence, case): words
        for claim in its.claims
        if claim.format not in CARRY_A_UNIT
        for case, one in cases(found[claim.evidence]).items()
        if (words := list(lacking(claim, claim.unit or one.unit)))
    }
    assert missing == {}


@pytest.mark.parametrize(
    ("entries", "unit", "words"),
    [
        ({"test": "at most", "bound": 2.0}, "", ["a unit"]),
        ({"test": "at most", "bound": 2.0}, "mm", []),
        ({"test": "between", "bound": [0.0, 1.0]}, "mm", []),
        ({"test": "above"}, "ms", ["the direction of a difference, as in `ms less`"]),
        ({"test": "above"}, "ms less", []),
        ({"test": "below", "bound": 1.0}, "NMSE", ["what it is a multiple of, as in `times the NMSE`"]),
        ({"test": "below", "bound": 1.0}, "times the NMSE", []),
    ],
)
def test_what_a_cell_lacks(entries, unit, words):
    assert list(lacking(Claim(statement="s", source="IV", evidence="e", **entries), unit)) == words
