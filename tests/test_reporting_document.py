"""Documents: templates with strict names, anchors, sources; reports as files, byte for byte the same."""

import json
import sys

import numpy as np
import pandas as pd
import pytest
from jinja2 import UndefinedError

from structlearn.reporting.claims import VERDICTS, Claim, exact, judge
from structlearn.reporting.document import Document, Panel, Source, Table, environment, render, words_in_view
from structlearn.reporting.figure_style import PANEL_WIDTH, Raster, canvas, styled
from structlearn.reporting.findings import Findings
from structlearn.reporting.publishing import publish_report

TEMPLATE = """{% extends "document.html.jinja" %}
{% block title %}{{ name }}{% endblock %}
{% block opening %}<p class="lead">{{ error | f(".1f") }}</p>{% endblock %}
{% block sections %}
{% call section("First & foremost") %}
{% call figure("curve", alt="a line", source="scores") %}Seen by <em>eye</em>.{% endcall %}
{{ table("rows", "All <rows>.") }}
{{ recording("run", "one run") }}
{% endcall %}
{% endblock %}
{% block folded %}{% call fold("Hidden") %}<p>four words in here</p>{% endcall %}{% endblock %}
"""
ROWS = Table(pd.DataFrame({"a": [-1.25, np.nan], "b": [True, False]}), {"a": ".1f"}, strong=frozenset({1}))
FACTS = {"name": "<Page>", "error": -0.04}


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A testbed's page package with one template."""
    folder = tmp_path / "made_up_page"
    folder.mkdir()
    (folder / "__init__.py").write_text("")
    (folder / "page.html.jinja").write_text(TEMPLATE)
    monkeypatch.syspath_prepend(tmp_path)
    environment.cache_clear()
    yield "made_up_page"
    sys.modules.pop("made_up_page", None)
    environment.cache_clear()


def document(package, **changes):
    claim = Claim(statement="{{ name }} holds", source="IV", evidence="it", test="zero")
    judged = judge([claim], {"it": exact(0.0, 7)}, environment(package), FACTS)
    parts = {
        "facts": FACTS,
        "tables": {"rows": ROWS},
        "judged": judged,
        "sources": {"scores": Source("data/scores.parquet", "score")},
        "recordings": "../rerun/made_up",
        "simulated": True,
    }
    return Document("page.html.jinja", package, "report_made_up", **parts | changes)


@styled
def curve(slope=1.0):
    figure = canvas(2.0, PANEL_WIDTH)
    figure.subplots().plot([0.0, 1.0], [0.0, slope])
    return figure


PANELS = {"curve": [Panel("figures/curve.svg", 451, 192)]}


def test_a_page_has_anchors_sources_and_escapes_what_it_is_given(package):
    html = render(document(package), PANELS)
    assert '<a href="#first-foremost">First &amp; foremost</a>' in html.split("<main>")[0]
    assert "&lt;Page&gt; holds" in html
    assert "<em>eye</em>" in html
    assert "All &lt;rows&gt;." in html
    assert "dvc repro score" in html
    assert 'href="../rerun/made_up/run.rrd"' in html
    assert "\N{MINUS SIGN}1.2" in html  # of -1.25; and the missing value is a dash
    assert ">simulated</span>" in html
    assert words_in_view(html) == words_in_view(html.replace("four words in here", "one"))  # they are folded


@pytest.mark.parametrize(
    ("changes", "error"),
    [({"facts": {"name": "x"}}, UndefinedError), ({"tables": {}}, KeyError), ({"sources": {}}, KeyError)],
)
def test_what_is_named_must_be_there(package, changes, error):
    with pytest.raises(error):
        render(document(package, **changes), PANELS)


@pytest.mark.parametrize("value", [np.nan, -np.inf])
def test_a_number_that_no_run_gave_has_a_word(package, value):
    assert '<p class="lead">unknown</p>' in render(document(package, facts=FACTS | {"error": value}), PANELS)


def publish_twice(package, tmp_path, drawings, headlines=("error",), numbers=None):
    find = Findings.of_metrics(numbers or {"error": 1.5, "other": 2}, headlines)
    written = []
    for name in ("a", "b"):
        publish_report(tmp_path / name, {"index": document(package)}, drawings(), {"rows": ROWS}, find)
        written.append({path.name: path.read_bytes() for path in (tmp_path / name).rglob("*.*")})
    assert written[0] == written[1]
    return written[0]


def test_a_report_has_the_same_bytes_every_time(package, tmp_path):
    files = publish_twice(
        package, tmp_path, lambda: {"curve": [curve(), curve(-1.0)], "dots": Raster(curve())}
    )
    assert {"curve-1.svg", "curve-2.svg", "dots.png", "rows.csv", "claims.csv", "index.html"} <= set(files)
    counts = {f"claims_{word.replace(' ', '_')}": int(word == "yes") for word in VERDICTS}
    assert json.loads(files["metrics.json"]) == {"error": 1.5} | counts
    assert files["findings.csv"].splitlines()[1:] == [
        b"error,,1.5,1.5,1.5,1,,,True,,",
        b"other,,2,2,2,1,,,False,,",
    ]
    assert b"figures/curve-2.svg" in files["index.html"]


def test_headlines_are_few(package, tmp_path):
    many = {f"m{number}": number for number in range(13)}
    with pytest.raises(ValueError, match="13 headlines are more than 12"):
        publish_twice(package, tmp_path, lambda: {"curve": curve()}, tuple(many), many)
