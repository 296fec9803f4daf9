"""The page that sets simulated touch beside recorded touch."""

import pytest
from test_recorded_touch_statistics import PARAMETERS, traces

from structlearn.reporting.figures import save
from structlearn.reporting.page import render
from structlearn.testbeds.recorded.page.calibration_page import calibration_page, pictures
from structlearn.testbeds.recorded.page.calibration_results import (
    STATISTICS,
    CalibrationResults,
    metrics,
    tables,
)
from structlearn.testbeds.recorded.protocol import touch_calibration


def gathered(gain: float) -> CalibrationResults:
    fingers = traces(gain)
    electrodes = touch_calibration.electrode_table(fingers, PARAMETERS)
    spectra = touch_calibration.spectrum_table(fingers, PARAMETERS)
    table = touch_calibration.finger_table(fingers, electrodes, PARAMETERS)
    return CalibrationResults(
        comparison=touch_calibration.comparison(table, spectra, PARAMETERS),
        electrodes=electrodes,
        fingers=table,
        spectra=spectra,
        components=touch_calibration.component_table(fingers),
        traces=touch_calibration.trace_table(fingers, PARAMETERS),
    )


@pytest.fixture(scope="module")
def results():
    return gathered(3.0)


def page(results: CalibrationResults) -> str:
    return render(calibration_page(results, {}, "calibrate", PARAMETERS))


def test_every_statistic_has_a_name(results):
    assert list(results.comparison["statistic"]) == list(STATISTICS)


def test_the_page_says_what_agrees_and_what_does_not(results):
    text = page(results)
    agree = int(results.comparison["agrees"].sum())
    assert f"{agree} of {len(STATISTICS)}" in text
    assert f"{agree} statistics agree. These do not: contact, strongest electrode (counts): 190" in text
    assert text.count('class="badge"') >= 4  # what is simulated is labelled so
    assert "nan" not in text.replace("nano", "")


def test_the_page_of_equals_has_nothing_to_complain_about():
    assert f"{len(STATISTICS)} statistics agree. None lies outside." in page(gathered(1.0))


def test_the_same_results_give_the_same_page(results):
    assert page(results) == page(gathered(3.0))


def test_metrics_are_flat_numbers(results):
    values = metrics(results)
    assert values["contact_strongest_simulated"] / values["contact_strongest_recorded"] == pytest.approx(
        3, rel=0.05
    )
    assert values["compared"] == len(STATISTICS)
    assert values["agree"] == int(results.comparison["agrees"].sum())


def test_tables_and_figures_are_where_the_page_looks_for_them(results, tmp_path):
    text = page(results)
    for name in tables(results):
        if f"tables/{name}.csv" not in text:
            assert name in ("spectra", "components")  # beside the figures, for those who want the numbers
    figures = pictures(results, PARAMETERS)
    for name, figure in figures.items():
        assert f"figures/{name}.png" in text
        assert min(save(figure, tmp_path / f"{name}.png")) > 300
