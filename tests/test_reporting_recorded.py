"""The page of the recorded data, made from a few real recordings where they are at hand."""

import numpy as np
import pandas as pd
import pytest
from dynamics_tables import recorded_results, slide_tables
from scipy import stats

from structlearn.ground.params import read_parameters
from structlearn.primitives.fitting import FitParameters, segment_paths, whole
from structlearn.primitives.sequence import sequence_table
from structlearn.recordings import clmc, slide, synchronise
from structlearn.reporting.page import Page, render
from structlearn.testbeds.recorded.page import recorded_avoidance, recorded_corrections, recorded_latent_touch
from structlearn.testbeds.recorded.page.recorded_page import pictures, recorded_page
from structlearn.testbeds.recorded.page.recorded_results import RecordedResults, metrics, tables
from structlearn.testbeds.recorded.protocol import (
    avoidance_representations,
    correction_splits,
    human_reaches,
    latent_touch,
    scraping_execution,
    slides,
    touch_sets,
    unscrewing,
)
from structlearn.testbeds.recorded.protocol.corrected_reaches import complete, corrected_reaches
from structlearn.testbeds.recorded.protocol.panda_identification import RecordedDynamicsParameters

MODELS = {
    "recorded_reaches": human_reaches.ReachParameters,
    "recorded_corrections": correction_splits.CorrectionParameters,
    "recorded_unscrewing": FitParameters,
    "recorded_scraping": scraping_execution.ExecutionParameters,
    "recorded_slides": slides.SlideParameters,
    "recorded_avoidance": avoidance_representations.RecordedAvoidanceParameters,
    "recorded_latent_touch": latent_touch.LatentTouchParameters,
    "recorded_dynamics": RecordedDynamicsParameters,
}


@pytest.fixture(scope="module")
def parameters(root):
    read = {key: read_parameters(root / "params.yaml", key, model) for key, model in MODELS.items()}
    few = {"noise_mm": (0.0, 2.0), "seeds": 2}
    return read | {
        "recorded_reaches": read["recorded_reaches"].model_copy(update=few),
        "recorded_corrections": read["recorded_corrections"].model_copy(update={"splits": 3}),
    }


def avoidance_results(best=0.2, gain=0.1):
    """Made-up errors in which the ensemble that sees the phase is best, by `gain` with `gain` +- 0.01."""
    keys = ["representation", "inputs", "axis"]
    spread = np.array([-0.01, 0.0, 0.01, 0.0])
    rows = []
    for name, inputs in avoidance_representations.REPRESENTATIONS:
        for place, axis in enumerate("xyz"):
            error = best + 0.1 * place + (0.0 if inputs == "phase" else gain)
            error += 0.0 if name == avoidance_representations.ENSEMBLE else 0.5
            rows += [(name, inputs, axis, fold, error + part) for fold, part in enumerate(spread)]
    folds = pd.DataFrame(rows, columns=[*keys, "fold", "nmse"])
    scores = folds.groupby(keys, sort=False)["nmse"].mean().reset_index().assign(train=0.05)
    worth = scores[scores["inputs"] != "features"].query("representation != 'pmnn'")[keys].copy()
    worth["gain"] = np.where(worth["inputs"] == "phase", gain, 0.0)
    return avoidance_representations.RecordedAvoidanceResults(scores, folds, worth.assign(half_width=0.02))


def touch_results(own=0.1, carried=0.7, components=0.05):
    """Made-up errors: of networks on new trials and on new sets; of principal components on new trials."""
    rows = []
    for source, target, new in recorded_latent_touch.ASKED:
        for model in latent_touch.MODELS:
            for part, spread in enumerate((-0.01, 0.01)):
                error = carried if new == latent_touch.NEW_SET else own
                error += 0.02 if model == latent_touch.PLAIN else 0.0
                if model == latent_touch.COMPONENTS:
                    error = 0.5 if new == latent_touch.NEW_SET or source != touch_sets.SLIDES else components
                rows.append((source, target, new, model, part, 0, error + spread, 1.0, 0.3, 0.02))
    keys = ["learned_from", "asked_about", "new", "model", "part", "seed"]
    errors = [*recorded_latent_touch.ERRORS[:1], "worst_electrode", *recorded_latent_touch.ERRORS[1:]]
    sets = pd.DataFrame({"set": list(latent_touch.PARTNERS), "trials": 4, "samples": 900, "components": 6})
    numbers = ("counts", "against", "along_mm", "across_mm", "along_std_mm", "across_std_mm")
    pairs = [*((name, name) for name in touch_sets.RECORDED), *latent_touch.PARTNERS.items()]
    electrodes = np.arange(1, 20)
    matrix = {"electrode": np.repeat(electrodes, 19), "other": np.tile(electrodes, 19), "correlation": 0.5}
    return latent_touch.LatentTouchResults(
        errors=pd.DataFrame(rows, columns=[*keys, *errors]),
        sets=sets.assign(start_counts=21.0, end_counts=3.0, **dict.fromkeys(numbers, 0.25)),
        likeness=pd.DataFrame(pairs, columns=["first", "second"]).assign(correlation=0.4),
        correlations=pd.concat([pd.DataFrame({"set": name, **matrix}) for name in latent_touch.PARTNERS]),
    )


@pytest.fixture(scope="module")
def results(recorded_data, parameters):
    movements = [synchronise(one) for one in clmc.read_reaches(recorded_data / "clmc")[:12]]
    logs = [synchronise(one) for one in clmc.read_unscrewing(recorded_data / "clmc")]
    execution = [synchronise(one) for one in clmc.read_scraping_execution(recorded_data / "clmc")]
    names = ("mat9_1", "mat9_2", "mat9_12", "mat15_1")
    raw = [slide.read_slide(recorded_data / "slide", name) for name in names]
    primitive, errors = human_reaches.learn_reaches(movements, parameters["recorded_reaches"])
    segments = segment_paths(movements, whole(movements), 10.0)
    higher = [synchronise(one) for one in clmc.read_reaches(recorded_data / "clmc", "dataset2_part")]
    corrected = corrected_reaches(complete(higher), primitive.position, 10.0)
    _, corrections = correction_splits.learn_corrections(
        corrected, primitive.position.local, parameters["recorded_corrections"]
    )
    joint, turns = unscrewing.learn_unscrewing(logs, parameters["recorded_unscrewing"])
    _, path, distances = scraping_execution.learn_execution(execution, parameters["recorded_scraping"].fit)
    _, scores, traces = scraping_execution.learn_traces(execution, parameters["recorded_scraping"])
    _, deviations, statistics = slides.learn_slides(
        [synchronise(one, 100.0) for one in raw], parameters["recorded_slides"]
    )
    return RecordedResults(
        reach_segments=segments,
        reach_primitive=primitive,
        reach_errors=errors,
        reach_cut_errors=human_reaches.reach_cut_errors(movements, parameters["recorded_reaches"]),
        own_spread_mm=human_reaches.own_spread_mm(segments),
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
        avoidance=avoidance_results(),
        dynamics=recorded_results(),
        **dict(zip(("slide_torques", "slide_payloads"), slide_tables(), strict=True)),
        latent_touch=touch_results(),
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
        "obstacle_nmse_x",
        "obstacle_nmse_y",
        "obstacle_nmse_z",
        "panda_nmse_default",
        "panda_nmse_cov_viscous",
        "panda_nmse_cov_coulomb",
        "panda_nmse_mlp",
        "touch_reconstruction_nmse_slides",
        "touch_reconstruction_nmse_unscrewing",
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


def avoidance_page(made_up):
    return render(Page("Avoidance", "", (recorded_avoidance.section(made_up, {}),)))


def test_obstacle_metrics_are_those_of_one_best_model():
    values = recorded_avoidance.metrics(avoidance_results())
    assert [values[f"obstacle_nmse_{axis}"] for axis in "xyz"] == pytest.approx([0.2, 0.3, 0.4])
    assert values["obstacle_phase_gain_y"] == pytest.approx(0.1)
    table = recorded_avoidance.score_table(avoidance_results())
    assert len(table) == len(avoidance_representations.REPRESENTATIONS)
    best = table.iloc[recorded_avoidance.best_row(avoidance_results())]
    assert (best["model"], best["sees"]) == ("ensemble of networks", "features, phase and its velocity")


def test_obstacle_section_says_what_it_tests_and_whether_the_aims_are_met():
    page = avoidance_page(avoidance_results())
    assert "not of new demonstrations" in page
    assert "best: 0.20, 0.30, 0.40 along x, y and z" in page
    assert "The aim of 0.25, 0.27, 0.42 is missed along y." in page
    assert "is met on every axis" in avoidance_page(avoidance_results(best=0.1))
    assert "tables/avoidance_phase.csv" in page


def test_the_worth_of_the_phase_comes_with_its_interval():
    assert "0.10 [0.08, 0.12] along x" in avoidance_page(avoidance_results())
    assert "interval above zero along x, y and z;" in avoidance_page(avoidance_results())
    assert "interval above zero along no axis;" in avoidance_page(avoidance_results(gain=0.01))
    table = recorded_avoidance.worth_table(avoidance_results())
    assert list(table["model"].unique()) == ["ridge regression", "network", "ensemble of networks"]


def test_the_figure_of_avoidance_has_a_panel_per_axis():
    figure = recorded_avoidance.errors_figure(avoidance_results())
    assert [panel.get_title(loc="left") for panel in figure.axes] == ["Local x", "Local y", "Local z"]
    rows = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert len(rows) == len(avoidance_representations.REPRESENTATIONS)


def touch_page(made_up):
    return render(Page("Touch", "", (recorded_latent_touch.section(made_up, {}),)))


def test_touch_metrics_are_those_of_the_structured_latent_space():
    values = recorded_latent_touch.metrics(touch_results())
    assert values["touch_reconstruction_nmse_slides"] == pytest.approx(0.1)
    assert values["touch_components_nmse_slides"] == pytest.approx(0.05)
    assert values["touch_mds_nmse_unscrewing"] == pytest.approx(0.3)
    assert values["touch_reconstruction_nmse_simulated_to_unscrewing"] == pytest.approx(0.7)
    assert values["touch_electrode_correlation_simulated_slides"] == pytest.approx(0.4)
    assert all(name.startswith("touch_") for name in values)


def test_touch_section_says_what_carries_over_and_what_the_counts_are():
    page = touch_page(touch_results())
    assert "published as magnitudes" in page
    assert "from 21 counts at the start of a slide to 3 at its end" in page
    assert "does not serve a real finger as it is" in page
    assert "serves a real finger as it is" in touch_page(touch_results(carried=0.2))
    assert "would leave 0.84" in page  # 16 of 19 electrodes' worth of variance
    for name in recorded_latent_touch.tables(touch_results()):
        assert f"tables/{name}.csv" in page


def test_what_carries_over_most_is_told_by_its_share():
    """Of networks: 1 - 0.2 of what would be 1 - 0.1 after learning from the set itself."""
    assert "by the structured latent space: 89 % of the variance" in touch_page(touch_results(carried=0.2))
    assert "by principal components: " in touch_page(touch_results())


def test_the_table_of_touch_has_means_and_spreads():
    table = recorded_latent_touch.score_table(touch_results())
    assert len(table) == len(recorded_latent_touch.ASKED)
    assert table.loc[0, latent_touch.STRUCTURED] == "0.10 ± 0.01"
    assert list(table["asked about"][:3]) == [
        latent_touch.NEW_TRIALS,
        latent_touch.NEW_MATERIAL,
        latent_touch.OWN_UNITS,
    ]


def test_figures_of_touch_show_every_question_and_every_set():
    made = recorded_latent_touch.pictures(touch_results())
    rows = [label.get_text() for label in made["latent_touch"].axes[0].get_yticklabels()]
    assert rows[3] == "simulated, magnitudes \N{RIGHTWARDS ARROW} slides"
    assert len(rows) == len(recorded_latent_touch.ASKED)
    panels = made["latent_touch_electrodes"].axes[:4]
    assert [panel.get_title(loc="left").lower() for panel in panels] == [
        "slides",
        "simulated, magnitudes",
        "unscrewing",
        "simulated",
    ]
