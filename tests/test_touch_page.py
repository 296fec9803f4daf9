"""Pages of touch on made-up tables, in which every claim holds: what there is is shown."""

from functools import lru_cache

import numpy as np
import pandas as pd
import pytest
import test_touch_skin
from committed import ROOT, committed_entry
from reporting_verdicts import AnyFigure
from test_finger_statistics import fingers

from dissertation.evidence.claims import judge, read_claims
from dissertation.recorded import set_page
from dissertation.recorded.transfer.learning import PARTNERS, SLIDES
from dissertation.recorded.transfer.page import find_transfer
from structlearn.core.artefacts import write_csv, write_table
from structlearn.reporting.document import render, words_in_view
from structlearn.tasks.task_entry import source_digests, write_task
from structlearn.tasks.task_files import LEFT_OUT, TaskFiles
from structlearn.tasks.touch.page import find_surfaces
from structlearn.tasks.touch.skin_section import SkinRuns, find_skin
from structlearn.tasks.touch.touch_names import COMPONENTS, PLAIN, STRUCTURED


def rows(columns, values):
    return pd.DataFrame(values, columns=columns.split())


@lru_cache
def surfaces():
    """Slides over two materials that differ."""
    groups = dict.fromkeys(("m9_1", "m9_2", "m9_4"), "learned") | {"m9_3": "left out"}
    groups |= {f"m15_{trial}": "other material" for trial in range(1, 5)}
    level = {"learned": 5.0, "left out": 6.0, "other material": 20.0}
    slides = rows("demonstration group", groups.items())
    parts, trial = slides["demonstration"].str.split("_", expand=True), slides["group"].map(level)
    slides, extra = slides.assign(material=parts[0]), 0.01 * parts[1].astype(int)
    alone = slides[["demonstration", "material"]]
    alone = alone.assign(rms=5.0 + 10 * extra, standard=1.0 + extra, nmse=0.3 + extra)
    across = alone.assign(expected=parts[0].map({"m9": "m15", "m15": "m9"}), nmse=2.0)
    channels = [alone.assign(channels=kind, electrodes=8, rms=5.0) for kind in ("strong", "weak")]
    time = {"time_s": np.arange(40) / 100, "mean": 1.0}
    statistics = [
        pd.DataFrame(time | {"group": group, "electrode": electrode, "std": electrode})
        for group in level
        for electrode in range(1, 4)
    ]
    clock = "kind samples median_gap_ms longest_gap_ms rms_error max_error"
    return {
        "clock_errors": rows(clock, [(kind, 100, 6.6, 150.0, 1e-4, 3e-3) for kind in ("pose", "wrench")]),
        "deviations": slides.drop(columns="material").assign(rms=trial + extra, largest=40.0),
        "left_one_out": alone,
        "channels": pd.concat(channels),
        "across_materials": across.assign(rms=60.0 + extra, standard=3.0 + extra),
        "statistics": pd.concat(statistics),
    }


@lru_cache
def transfer():
    """Sets whose latent spaces are good and carry over, and fingers that are alike."""
    error = 0.01
    nmse = {STRUCTURED: error, PLAIN: error, COMPONENTS: 0.5}
    sets = [*PARTNERS, *PARTNERS.values()]
    tests = [*((name, name) for name in sets), *((partner, name) for name, partner in PARTNERS.items())]
    errors = [
        (*key, model, part, 0, nmse[model] + 0.001 * part, error + 0.001 * part, 0.02)
        for key in tests
        for model in nmse
        for part in range(4)
    ]
    columns = "learned_from test_run model part seed reconstruction distances pressure"
    return {
        "errors": rows(columns, errors),
        "sets": pd.DataFrame({"set": sets, "trials": 4, "components": 6}),
        "fingers": fingers(1.0),
    }


def skin():
    return dict(test_touch_skin.made_up().tables)


MADE_UP = {"eflesh": skin, "slides": surfaces, "biotac": transfer}
FIND = {
    "eflesh": lambda tables: find_skin(SkinRuns(tables, ("a",))),
    "slides": find_surfaces,
    "biotac": find_transfer,
}


@pytest.mark.parametrize("name", MADE_UP)
def test_every_claim_can_say_yes(name):
    """That each can say no as well is a test of its own, over all pages."""
    claims = read_claims(ROOT / f"src/dissertation/recorded/claims/{name}.yaml")
    judged = judge(claims, FIND[name](MADE_UP[name]()), {})
    assert {one.verdict for one in judged} == {"yes"}


@pytest.fixture
def shown(tmp_path, monkeypatch):
    """Of a task with these tables: its page in HTML, and what was found."""
    monkeypatch.chdir(tmp_path)
    published = []
    monkeypatch.setattr(set_page, "publish_judged", lambda *given, **_: published.append(given))

    def show(name, tables):
        files = TaskFiles(name)
        changes = {"tuned_on": ["a"]} if name == "eflesh" else {}
        entry = committed_entry(name, source="$DATA/none", **changes)
        write_task(entry, source_digests(entry), files.parameters)
        write_csv(pd.DataFrame({"file": [], "reason": []}), files.recorded / LEFT_OUT)
        for table, its in tables.items():
            write_table(its, files.learned / f"{table}.parquet")
        set_page.publish_set(files)
        _, pages, drawn, _, find = published[-1]
        page = render(pages["index"], AnyFigure())
        assert words_in_view(page) <= 1000
        assert all(f"figure-{picture}" in page for picture in drawn)
        return page, find

    return show


SKIN_TABLES = ("errors", "map", "maps", "servo", "paths", "force", "lags", "traces")


@pytest.mark.parametrize(
    "there", [(*SKIN_TABLES, "recordings", "published"), SKIN_TABLES[:2], ("force", "lags", "traces")]
)
def test_a_skin_is_shown_as_far_as_it_was_recorded(there, shown):
    tables = skin()
    tables["map"] = tables["maps"]
    tables["recordings"] = pd.DataFrame({"recording": ["a"], "samples": [25], "touching": [25]})
    alone = tables["errors"][tables["errors"]["learned_from"] == tables["errors"]["test_run"]]
    if "maps" not in there:
        tables["errors"] = alone
    if "recordings" not in there:
        there = (*there, "recordings")
    page, find = shown("eflesh", {name: tables[name] for name in there})
    assert ("Servoing in the recorded map" in page) == ("paths" in there)
    assert ("a probe moves down" in page) == ("traces" in there)
    assert ("map_nmse" in find.numbers()) == ("errors" in there)


@pytest.mark.parametrize("missing", ["slides", "unscrewing"])
def test_touch_goes_on_with_one_of_its_sets(missing, shown):
    gone, tables = {missing, PARTNERS[missing]}, dict(transfer())
    for name, columns in (("errors", ("learned_from", "test_run")), ("sets", ("set",))):
        for column in columns:
            tables[name] = tables[name][~tables[name][column].isin(gone)]
    del tables["fingers"]  # no scraping was recorded
    page, find = shown("biotac", tables)
    left = "unscrewing" if missing == SLIDES else SLIDES
    assert list(find["reconstruction"]) == [left]
    assert "Simulated beside recorded touch" not in page
    assert find["contact"].reason == "no scraping execution is recorded here"
    assert "Simulated beside recorded touch" in shown("biotac", transfer())[0]


def test_slides_over_one_material_are_enough(shown):
    tables = dict(surfaces())
    for name in ("deviations", "left_one_out", "channels"):
        its = tables[name]
        tables[name] = its[its["demonstration"].isin(["m9_1", "m9_2"])]
    tables["across_materials"] = tables["across_materials"][:0]
    tables["statistics"] = tables["statistics"].query("group == 'learned'")
    page, _ = shown("slides", tables)
    assert "it takes two slides over each of two materials" in page
    assert "it takes two slides" not in shown("slides", surfaces())[0]


def test_fingers_that_differ_are_told():
    claims = read_claims(ROOT / "src/dissertation/recorded/claims/biotac.yaml")
    judged = judge(claims, find_transfer(transfer() | {"fingers": fingers(3.0)}), {})
    words = {one.claim.evidence: one.verdict for one in judged}
    assert (words["contact"], words["noise"]) == ("no", "yes")
