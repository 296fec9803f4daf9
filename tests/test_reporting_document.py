"""Documents: templates with strict names, anchors, sources, verdicts; reports, byte for byte the same."""

import json
import sys

import numpy as np
import pandas as pd
import pytest
from jinja2 import UndefinedError

from dissertation.evidence.claims import VERDICTS, Claim, judge
from dissertation.evidence.judged_page import JudgedDocument, publish_judged
from structlearn.reporting.document import Document, Panel, Source, Table, environment, render, words_in_view
from structlearn.reporting.evidence import exact
from structlearn.reporting.figure_style import PANEL_WIDTH, Raster, canvas, styled
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import rounded
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


def document(package, kind=Document, **changes):
    parts = {
        "facts": FACTS,
        "tables": {"rows": ROWS},
        "sources": {"scores": Source("data/scores.parquet", "score")},
        "recordings": "../rerun/made_up",
        "simulated": True,
    }
    return kind("page.html.jinja", package, "report_made_up", **parts | changes)


def judged_document(package):
    claim = Claim(statement="{{ name }} holds", source="IV", evidence="it", test="zero")
    return document(package, JudgedDocument, judged=judge([claim], {"it": exact(0.0, 7)}, FACTS))


@styled
def curve(slope=1.0):
    figure = canvas(2.0, PANEL_WIDTH)
    figure.subplots().plot([0.0, 1.0], [0.0, slope])
    return figure


PANELS = {"curve": [Panel("figures/curve.svg", 451, 192)]}


def test_a_page_has_anchors_sources_and_escapes_what_it_is_given(package):
    html = render(document(package), PANELS)
    assert '<a href="#first-foremost">First &amp; foremost</a>' in html.split("<main>")[0]
    assert "<h1>&lt;Page&gt;" in html
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


@pytest.mark.parametrize(
    ("value", "how", "words"),
    [
        (7.63e4, ".2e", "76 300"),
        (112.4, ".2g", "110"),
        (-6e-12, ".0e", "\N{MINUS SIGN}6 \N{MULTIPLICATION SIGN} 10⁻¹²"),
        (-0.04, ".1f", "0.0"),
    ],
)
def test_a_number_has_no_e(value, how, words):
    assert rounded(value, how).replace("\N{NARROW NO-BREAK SPACE}", " ") == words


@pytest.mark.parametrize(("rows", "shown"), [(24, True), (25, False)])
def test_a_long_table_is_its_file(package, rows, shown):
    table = Table(pd.DataFrame({"number": np.arange(rows)}))
    html = render(document(package, tables={"rows": table}), PANELS)
    assert ('<td class="number">7</td>' in html) == shown
    assert ("rows.csv</a>, 25 rows" in html) != shown


def test_verdicts_stand_before_the_sections_of_a_page_of_the_reproduction(package):
    html, plain = render(judged_document(package), PANELS), render(document(package), PANELS)
    assert "&lt;Page&gt; holds" in html
    assert html.index('<p class="lead">') < html.index('id="verdicts"') < html.index('id="first-foremost"')
    assert '<a class="up" href="../index.html">' in html
    assert '<a href="../scraping/index.html">' in html
    for theirs in ("erdict", "../index.html", "../scraping", "testbed"):  # a lab's page links to no testbed
        assert theirs not in plain.partition("</style>")[2]


def publish_twice(publish, page, tmp_path, drawings, headlines=("error",), numbers=None):
    find = Findings.of_metrics(numbers or {"error": 1.5, "other": 2}, headlines)
    written = []
    for name in ("a", "b"):
        publish(tmp_path / name, {"index": page}, drawings(), {"rows": ROWS}, find)
        written.append({path.name: path.read_bytes() for path in (tmp_path / name).rglob("*.*")})
    assert written[0] == written[1]
    return written[0]


def test_a_report_has_the_same_bytes_every_time(package, tmp_path):
    drawings = {"curve": [curve(), curve(-1.0)], "dots": Raster(curve())}
    files = publish_twice(publish_report, document(package), tmp_path, lambda: drawings)
    written = {"curve-1.svg", "curve-2.svg", "dots.png", "rows.csv", "index.html"}
    assert set(files) == written | {"findings.csv", "metrics.json"}
    assert json.loads(files["metrics.json"]) == {"error": 1.5}
    assert files["findings.csv"].splitlines()[1:] == [
        b"error,,1.5,1.5,1.5,1,,,True,,",
        b"other,,2,2,2,1,,,False,,",
    ]
    assert b"figures/curve-2.svg" in files["index.html"]


def test_a_report_with_verdicts_has_their_table_and_counts(package, tmp_path):
    files = publish_twice(publish_judged, judged_document(package), tmp_path, lambda: {"curve": curve()})
    assert b"<Page> holds" in files["claims.csv"]
    counts = {f"claims_{word.replace(' ', '_')}": int(word == "yes") for word in VERDICTS}
    assert json.loads(files["metrics.json"]) == {"error": 1.5} | counts


def test_headlines_are_few(package, tmp_path):
    many = {f"m{number}": number for number in range(13)}
    with pytest.raises(ValueError, match="13 headlines are more than 12"):
        publish_twice(
            publish_report, document(package), tmp_path, lambda: {"curve": curve()}, tuple(many), many
        )
