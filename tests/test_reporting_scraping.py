import json
import re
from dataclasses import replace

import numpy as np
import pytest
from reporting_scraping import FIT, PARAMETERS, demonstration, noise_table, positions_only, scraping_results

from structlearn.ground.artefacts import write_metrics
from structlearn.reporting.figures import save
from structlearn.reporting.page import render
from structlearn.testbeds.scraping.page.primitive_figures import sequence_figure
from structlearn.testbeds.scraping.page.scraping_page import pictures, scraping_page
from structlearn.testbeds.scraping.page.scraping_results import metrics, tables

PARAMETER_MODELS = {"segment": PARAMETERS, "fit_primitives": FIT}


def still(name):
    one = demonstration(9)
    return replace(one, name=name, position=np.zeros_like(one.position))


@pytest.fixture(scope="module")
def simulated():
    return scraping_results([demonstration(seed) for seed in range(3)])


@pytest.fixture(scope="module")
def recorded():
    return scraping_results(
        [*(positions_only(demonstration(seed)) for seed in range(3)), positions_only(still("bad"))]
    )


@pytest.fixture(scope="module")
def drawn(recorded):
    return pictures(recorded)


def page(results):
    return render(scraping_page(results, {}, PARAMETER_MODELS))


def shown_figures(results):
    return set(re.findall(r'<img src="figures/(\w+)\.png"', page(results)))


def test_page_shows_every_figure_and_only_those(simulated, recorded, drawn):
    assert shown_figures(simulated) == set(pictures(simulated))
    assert shown_figures(recorded) == set(drawn)


def test_page_links_only_tables_that_are_written(simulated, recorded):
    for results in (simulated, recorded):
        assert set(re.findall(r'href="tables/(\w+)\.csv"', page(results))) <= set(tables(results))


def test_page_needs_no_network_and_no_script(simulated):
    html = page(simulated)
    assert not re.search(r'(src|href)="(https?:)?//', html)
    assert "<script" not in html
    assert "@import" not in html


def test_page_is_deterministic(simulated):
    assert page(simulated) == page(simulated)


def test_page_says_what_was_left_out_and_why(recorded):
    html = page(recorded)
    assert "1 demonstration could not be cut and was left out" in html
    assert "its speed never exceeds 0.02 m/s" in html


def test_only_simulated_data_are_labelled_simulated(simulated, recorded):
    assert re.search(r"<h1>[^\n]*badge", page(simulated))
    html = page(recorded)
    assert not re.search(r"<h1>[^\n]*badge", html)
    assert re.findall(r"<h2>([^<]*) <span class=\"badge\"", html) == ["Robustness against noise"]


def test_metrics_of_simulated_demonstrations(simulated):
    values = metrics(simulated)
    for method in ("zvc", "dtw", "ls", "wls_text", "wls"):
        assert 0.0 <= values[f"cut_error_ms_{method}"] < 500.0
        assert f"sweep_cut_error_ms_{method}_0p3mm" in values
    for primitive in ("down", "turn", "scrape"):
        for name in ("mean_mm", "max_mm", "end_mm", "mean_deg", "end_deg"):
            assert f"fit_{primitive}_{name}" in values
        assert values[f"left_one_out_{primitive}_mean_mm"] >= 0.0
    assert {"spread_mm_ls_down", "spread_mm_wls_scrape"} <= set(values)
    assert values["wls_wins_at_every_noise_level"] is True
    assert values["acceleration_jump_nominal"] < 0.05  # eq. IV.12; 100 Hz here
    assert values["demonstrations_left_out"] == 0


def test_metrics_of_recorded_positions_leave_out_what_is_not_known(recorded, tmp_path):
    values = metrics(recorded)
    assert values["demonstrations_left_out"] == 1
    assert not [key for key in values if key.startswith("cut_error") or key.endswith("deg")]
    write_metrics(values, tmp_path / "metrics.json")  # raises on NaN
    assert json.loads((tmp_path / "metrics.json").read_text()).keys() == values.keys()


def test_prose_follows_the_numbers(simulated):
    worse = replace(simulated, noise=noise_table(advantage_ms=-5.0))
    assert metrics(worse)["wls_wins_at_every_noise_level"] is False
    assert "does not have the smallest error everywhere" in page(worse)
    assert "has the smallest error at every level" in page(simulated)


def test_a_single_person_decides_nothing(simulated):
    html = page(replace(simulated, noise=noise_table().query("seed == 0")))
    assert "nan" not in re.sub(r"<style>.*?</style>", "", html, flags=re.DOTALL).lower().split()
    assert "not distinguishable from" in html


def test_one_demonstration_alone_gives_a_page():
    results = scraping_results([positions_only(demonstration(0))])
    assert "Only the reference could be cut" in page(results)
    assert shown_figures(results) == set(pictures(results))


def test_pictures_are_small_and_say_nothing_of_versions(drawn, tmp_path):
    for name in ("demonstrations", "noise_sweep", "position_fit", "space"):
        path = tmp_path / f"{name}.png"
        save(drawn[name], path)
        content = path.read_bytes()
        assert len(content) < 200_000
        assert b"tEXt" not in content
        assert b"matplotlib" not in content.lower()


def test_pictures_are_the_same_every_time(recorded, tmp_path):
    for attempt in ("first.png", "second.png"):
        save(sequence_figure({"one": recorded.nominal}), tmp_path / attempt)
    assert (tmp_path / "first.png").read_bytes() == (tmp_path / "second.png").read_bytes()
