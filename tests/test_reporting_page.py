import re

import numpy as np
import pandas as pd
import pytest

from structlearn.ground.params import Parameters
from structlearn.reporting.overview import DYNAMICS, OBSTACLES, SCRAPING, SERVOING, overview_page
from structlearn.reporting.page import (
    Figure,
    KeyNumber,
    Link,
    Links,
    Page,
    Prose,
    Section,
    Table,
    cell,
    render,
)
from structlearn.reporting.parameter_table import parameter_table
from structlearn.reporting.prose import listing


def page(*blocks):
    section = Section("A <b>heading</b>", blocks)
    return render(Page("Title & more", "Lead", (section,), (KeyNumber("1 < 2", "a `key`"),)))


def test_text_is_escaped_everywhere():
    evil = '<script>"x"</script>'
    html = page(
        Prose(evil),
        Figure("figures/a.png", evil, evil),
        Table(pd.DataFrame({evil: [evil]}), evil),
        Links((Link("a.csv", evil, evil),)),
    )
    assert "<script" not in html
    assert "A &lt;b&gt;heading" in html
    assert "1 &lt; 2" in html
    assert "Title &amp; more" in html


def test_backticks_become_code_and_their_text_is_escaped():
    assert "<code>a &lt; b</code>" in page(Prose("see `a < b` there"))


def test_rendering_is_deterministic():
    table = Table(pd.DataFrame({"x": [1.0]}))
    assert page(table) == page(table)


@pytest.mark.parametrize(
    ("value", "number_format", "text"),
    [
        (1.2345, ".2f", "1.23"),
        (-0.5, ".1f", "\N{MINUS SIGN}0.5"),
        (np.int64(7), "", "7"),
        (float("nan"), ".1f", "\N{EN DASH}"),
        (None, "", "\N{EN DASH}"),
        (np.bool_(True), "", "yes"),
        ("a-b", ".1f", "a-b"),
    ],
)
def test_cells(value, number_format, text):
    assert cell(value, number_format) == text


def test_tables_align_numbers_right_and_name_columns():
    frame = pd.DataFrame({"name": ["a", "b"], "error": [1.0, 2.0], "holds": [True, False]})
    html = page(
        Table(frame, formats={"error": ".2f"}, headings={"error": "error (mm)"}, strong=frozenset({1}))
    )
    assert '<th class="number">error (mm)</th>' in html
    assert '<tr><td>a</td><td class="number">1.00</td><td>yes</td></tr>' in html
    assert '<tr class="strong"><td>b</td>' in html


def test_parameters_are_named_as_for_an_experiment():
    class Inner(Parameters):
        rate_hz: float = 300.0

    class Outer(Parameters):
        inner: Inner = Inner()
        axes: tuple[bool, bool] = (True, False)
        reference: str | None = None

    frame = parameter_table({"stage": Outer()}).frame
    assert dict(frame.to_numpy().tolist()) == {
        "stage.inner.rate_hz": "300",
        "stage.axes": "yes, no",
        "stage.reference": "\N{EN DASH}",
    }


def test_overview_shows_what_is_known_and_links_to_every_report():
    cards = [
        (SCRAPING, {"demonstrations": 11, "simulated": True}),
        (OBSTACLES, {"hits_unseen_baseline": 37, "goal_distance_max_m": 0.0372, "simulated": True}),
        (DYNAMICS, {"epochs_cov": 2.0, "ee_velocity_nmse_mlp": 5.54, "simulated": True}),
        (SERVOING, {"servo_success_rate": 0.957, "mds_nmse_test": 0.00545, "simulated": True}),
    ]
    html = render(overview_page(cards))
    assert 'href="scraping/index.html"' in html
    assert 'href="obstacles/index.html"' in html
    assert "<dd>37</dd>" in html
    assert "<dd>3.7 cm</dd>" in html
    assert 'href="servoing/index.html"' in html
    assert "<dd>96 %</dd>" in html
    assert 'href="dynamics/index.html"' in html
    assert "<dd>5.5</dd>" in html
    assert html.count("simulated</span>") == 4
    assert 'href="recorded/index.html"' in html
    assert 'href="times/index.html"' in html
    assert "<dd>11</dd>" in html
    assert "cut point</dt>" not in html  # true cut points are not known here
    assert not re.search(r'(src|href)="(https?:)?//', html)


def test_listing():
    assert [listing([]), listing("a"), listing("ab"), listing("abc")] == [
        "none",
        "a",
        "a and b",
        "a, b and c",
    ]
