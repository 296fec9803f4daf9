"""Verdicts of two processors: other digits are no other verdict, undecided is none either."""

import pandas as pd
import pytest

from structlearn.reporting.other_processor import (
    DIGITS,
    FLIPPED,
    MARGIN,
    SAME,
    compared,
    other_processor_page,
)

COLUMNS = ["statement", "case", "here", "verdict"]
HERE = pd.DataFrame(
    [("a", "", "1.0", "yes"), ("b", "", "2.0", "yes"), ("c", "x", "3", "no"), ("c", "y", "4", "yes")],
    columns=COLUMNS,
)


@pytest.mark.parametrize(
    ("row", "outcome"),
    [
        (("b", "", "2.0", "yes"), SAME),
        (("b", "", "2.1", "yes"), DIGITS),
        (("b", "", "2.1", "undecided"), MARGIN),
        (("b", "", "2.1", "no"), FLIPPED),
        (("b", "", "2.1", "not tested"), FLIPPED),
        (("another", "", "2.0", "yes"), FLIPPED),
    ],
)
def test_only_another_verdict_counts_as_one(row, outcome):
    there = HERE.copy()
    there.loc[1] = row
    table = compared({"toy": HERE}, {"toy": there}).set_index("statement")
    assert table.loc["b", "outcome"] == outcome
    assert set(table.drop(index=["b", "another"], errors="ignore")["outcome"]) == {SAME}
    page = other_processor_page(table.reset_index(), {"VARIABLE": "value"}, "a machine")
    assert "<code>VARIABLE=value</code>" in page


def test_cases_of_one_statement_are_kept_apart():
    there = HERE.assign(verdict=["yes", "yes", "no", "no"], here=["1.0", "2.0", "3", "5"])
    table = compared({"toy": HERE}, {"toy": there})
    assert table.set_index(["statement", "case"])["outcome"].to_dict() == {
        ("a", ""): SAME,
        ("b", ""): SAME,
        ("c", "x"): SAME,
        ("c", "y"): FLIPPED,
    }


def test_what_only_differs_from_the_row_above_is_shown_with_it():
    """Also where sorting would part them, and where two rows have the same words."""
    here = pd.DataFrame(
        [
            ("It learns", "", "1.0", "yes"),
            ("… in our variant", "", "2.0", "yes"),
            ("A hand arrives", "", "3", "yes"),
            ("… in our variant", "", "4", "yes"),
        ],
        columns=COLUMNS,
    )
    there = here.assign(here=["1.0", "2.1", "3", "4.1"], verdict=["yes", "undecided", "yes", "undecided"])
    page = other_processor_page(compared({"toy": here}, {"toy": there}), {}, "a machine")
    assert "<td>It learns … in our variant</td><td></td><td>2.0</td>" in page
    assert "<td>A hand arrives … in our variant</td><td></td><td>4</td>" in page
    assert "verdict there" in page
