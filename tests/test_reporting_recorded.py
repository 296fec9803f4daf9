"""The page of the recorded data, made from a few real recordings where they are at hand."""

import pytest
from scipy import stats

from structlearn.params import read_parameters
from structlearn.primitives.sequence import sequence_table
from structlearn.recorded import correction_splits, reaches, scraping, slides, unscrewing
from structlearn.recorded.corrected_reaches import complete, corrected_reaches
from structlearn.recordings import clmc, slide, synchronise
from structlearn.reporting import recorded_corrections
from structlearn.reporting.page import render
from structlearn.reporting.recorded_page import pictures, recorded_page
from structlearn.reporting.recorded_results import RecordedResults, metrics, tables
from structlearn.segmentation.learning import FitParameters, segment_paths, whole

MODELS = {
    "recorded_reaches": reaches.ReachParameters,
    "recorded_corrections": correction_splits.CorrectionParameters,
    "recorded_unscrewing": FitParameters,
    "recorded_scraping": scraping.ExecutionParameters,
    "recorded_slides": slides.SlideParameters,
}


@pytest.fixture(scope="module")
def parameters(root):
    read = {key: read_parameters(root / "params.yaml", key, model) for key, model in MODELS.items()}
    few = {"noise_mm": (0.0, 2.0), "seeds": 2}
    return read | {
        "recorded_reaches": read["recorded_reaches"].model_copy(update=few),
        "recorded_corrections": read["recorded_corrections"].model_copy(update={"splits": 3}),
    }


@pytest.fixture(scope="module")
def results(recorded_data, parameters):
    movements = [synchronise(one) for one in clmc.read_reaches(recorded_data / "clmc")[:12]]
    logs = [synchronise(one) for one in clmc.read_unscrewing(recorded_data / "clmc")]
    execution = [synchronise(one) for one in clmc.read_scraping_execution(recorded_data / "clmc")]
    names = ("mat9_1", "mat9_2", "mat9_12", "mat15_1")
    raw = [slide.read_slide(recorded_data / "slide", name) for name in names]
    primitive, errors = reaches.learn_reaches(movements, parameters["recorded_reaches"])
    segments = segment_paths(movements, whole(movements), 10.0)
    higher = [synchronise(one) for one in clmc.read_reaches(recorded_data / "clmc", "dataset2_part")]
    corrected = corrected_reaches(complete(higher), primitive.position, 10.0)
    _, corrections = correction_splits.learn_corrections(
        corrected, primitive.position.local, parameters["recorded_corrections"]
    )
    joint, turns = unscrewing.learn_unscrewing(logs, parameters["recorded_unscrewing"])
    _, path, distances = scraping.learn_execution(execution, parameters["recorded_scraping"].fit)
    _, scores, traces = scraping.learn_traces(execution, parameters["recorded_scraping"])
    _, deviations, statistics = slides.learn_slides(
        [synchronise(one, 100.0) for one in raw], parameters["recorded_slides"]
    )
    return RecordedResults(
        reach_segments=segments,
        reach_primitive=primitive,
        reach_errors=errors,
        reach_cut_errors=reaches.reach_cut_errors(movements, parameters["recorded_reaches"]),
        own_spread_mm=reaches.own_spread_mm(segments),
        corrections=corrections,
        unscrewing_segments=segment_paths(logs, whole(logs), 3.0),
        unscrewing_primitive=joint,
        unscrewing_errors=turns,
        execution=execution,
        execution_path=sequence_table(path, [part.name for part in execution]),
        execution_errors=distances,
        electrode_scores=scores,
        electrode_traces=traces,
        clock_errors=slides.clock_errors(raw),
        slide_deviations=deviations,
        slide_statistics=statistics,
    )


def test_metrics_have_the_agreed_names(results):
    assert {
        "reach_cut_error_ms_2mm",
        "reach_fit_mean_mm",
        "reach_fit_max_mm",
        "reach_fit_end_max_mm",
        "reach_left_ten_out_mean_mm",
        "coupling_path_mean_mm",
        "nominal_path_mean_mm",
        "corrected_spread_mm",
        "unscrewing_mean_deg_single",
        "unscrewing_mean_deg_joint",
        "unscrewing_end_deg_single",
        "unscrewing_end_deg_joint",
    } <= set(metrics(results))


def test_page_shows_all_figures_and_tables(results, parameters):
    made = pictures(results)
    page = render(recorded_page(results, dict.fromkeys(made, (10, 10)), parameters, ()))
    for name in made:
        assert f'src="figures/{name}.png"' in page
    for name in set(tables(results)) - {"reach_comparison"}:
        assert f"tables/{name}.csv" in page
    assert 'src="http' not in page


def test_the_page_says_how_many_reaches_were_corrected(results, parameters):
    values = metrics(results)
    assert values["corrected_reaches_learned_from"] == 20
    assert values["corrected_reaches_left_out"] == 8
    page = render(recorded_page(results, {}, parameters, ()))
    assert "30 more reaches" in page
    assert "20 are learned from and 8 left out, in 3 random splits" in page
    assert f"{values['coupling_path_mean_mm']:.1f} mm from the left-out reaches" in page


def test_differences_are_taken_reach_by_reach(results):
    """A reach that is left out more often counts no more than any other."""
    distances = results.corrections.distances
    differences = (distances["nominal_mm"] - distances["coupling_mm"]).groupby(distances["reach"]).mean()
    mean, half = recorded_corrections.paired_difference_mm(results.corrections, "nominal_mm", "coupling_mm")
    assert mean == pytest.approx(differences.mean())
    low, high = stats.ttest_1samp(differences, 0.0).confidence_interval()
    assert (mean - half, mean + half) == pytest.approx((low, high))
