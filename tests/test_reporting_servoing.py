"""The report of the servoing testbed, on a toy finger and tables whose numbers are known."""

import json
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from tactile_toy import toy_dataset

from structlearn.ground.artefacts import write_metrics
from structlearn.reporting.figures import save
from structlearn.reporting.page import Link, render
from structlearn.simulation.touch_demonstrator import ToucherParameters
from structlearn.tactile.electrodes import SKINS
from structlearn.tactile.geodesics import GeodesicParameters
from structlearn.tactile.latent_comparison import SPLITS, LatentParameters
from structlearn.tactile.latent_models import TRAINED_WITH
from structlearn.tactile.touch_dataset import OTHER
from structlearn.tactile.touch_preparation import TouchDataParameters
from structlearn.testbeds.servoing.page.servoing_claims import servoing_claims
from structlearn.testbeds.servoing.page.servoing_figures import forward_figure
from structlearn.testbeds.servoing.page.servoing_loop import ACTING, TEXT, ServoLoop
from structlearn.testbeds.servoing.page.servoing_loop_sections import shown
from structlearn.testbeds.servoing.page.servoing_other_skins import OtherSkins
from structlearn.testbeds.servoing.page.servoing_page import servoing_page
from structlearn.testbeds.servoing.page.servoing_results import ServoingResults, metrics
from structlearn.testbeds.servoing.page.servoing_sections import pictures
from structlearn.testbeds.servoing.page.servoing_tables import (
    directions,
    forward_at_test,
    latent,
    tables,
    test_chains,
)
from structlearn.testbeds.servoing.protocol.other_skins import OtherSkinsParameters
from structlearn.testbeds.servoing.protocol.servo_trials import MOTIONS, ServoTrialParameters, variants

test_chains.__test__ = False  # a table of the page, not a test
SEEDS = 4
SKIN = SKINS["biotac"]
SHIFT_M = 0.001
WOBBLE = 0.02 * np.array([-1.0, 1.0, -0.5, 0.5])
"""Relative deviations of the seeds, of mean zero."""


def spread(value):
    return value * (1.0 + WOBBLE)


def latent_table(reconstruction=0.05, distances=0.005):
    rows = [
        (structure, seed, split, error, 2 * error, near, 0.5 * near)
        for structure in (True, False)
        for split in SPLITS
        for seed, (error, near) in enumerate(
            zip(spread(reconstruction), spread(distances if structure else 1.0), strict=True)
        )
    ]
    columns = ["structure", "seed", "split", "reconstruction", "worst_electrode", "distances", "pressure"]
    return pd.DataFrame(rows, columns=columns)


def forward_table(with_structure=0.2, without=0.1, still=0.6, still_without=0.15):
    """NMSE at three steps; in proportion to the steps elsewhere."""
    rows = []
    kinds = [(kind, way) for kind, ways in TRAINED_WITH.items() for way in ways]
    for structure, error, nothing in ((True, with_structure, still), (False, without, still_without)):
        for kind, way, value in [(*pair, error) for pair in kinds] + [("unchanged", "none", nothing)]:
            rows += [
                (structure, seed, kind, way, steps, found * steps / 3)
                for steps in (1, 2, 3, 4)
                for seed, found in enumerate(spread(value))
            ]
    return pd.DataFrame(rows, columns=["structure", "seed", "forward", "trained_with", "steps", "nmse"])


def direction_table(best="NJ", without_loss=0.7):
    rows = []
    for structure in (True, False):
        for inverse in ("LL", "NG", "NJ"):
            for way in (inverse, "none"):
                value = without_loss if way == "none" else (0.1 if inverse == best else 0.3)
                for comparison, factor in (("forward", 0.5), ("encoder", 1.0), ("agreement", 0.2)):
                    for part, share in (("translation", 1.5), ("rotation", 0.5)):
                        rows += [
                            (structure, seed, inverse, way, comparison, part, factor * share * found)
                            for seed, found in enumerate(spread(value))
                        ]
    columns = ["structure", "seed", "inverse", "trained_with", "comparison", "part", "distance"]
    return pd.DataFrame(rows, columns=columns)


def curve_table():
    """Map distances fall below the published bound with the second point, reconstruction with the first."""
    rows = []
    quantities = {
        "reconstruction": (0.2, 0.1, 0.05),
        "distances": (0.03, 0.01, 0.005),
        "pressure": (0.1,) * 3,
    }
    quantities |= {
        f"forward {kind}-{way}": (0.4, 0.3, 0.2) for kind, ways in TRAINED_WITH.items() for way in ways
    }
    quantities |= {f"direction {one}-{one}": (0.5, 0.3, 0.1) for one in ("LL", "NG", "NJ")}
    for name, values in quantities.items():
        for step, value in zip((100, 200, 300), values, strict=True):
            rows += [(True, seed, name, found, step) for seed, found in enumerate(spread(value))]
    return pd.DataFrame(rows, columns=["structure", "seed", "quantity", "value", "step"])


def loop_tables(reached=None, lifted=0):
    """Trials of two seeds with six targets each; per controller a number of them is reached.

    Args:
        reached: by controller; others reach none.
        lifted: trials of each controller in which the finger comes off.
    """
    trials, progress, paths = [], [], []
    for variant in variants(3):
        keys = vars(variant)
        hits = (reached or {}).get(variant, 0)
        for number in range(12):
            success = number % 6 < hits // 2
            row = keys | {"seed": number // 6, "trial": number % 6, "motion": MOTIONS[number % 3]}
            for name, along in (("start", -0.01), ("target", -0.004)):
                place = SKIN.surface(along, 0.001 * number)
                row |= dict(zip((f"{name}_x_m", f"{name}_y_m", f"{name}_z_m"), place, strict=True))
            row |= {"position_error_mm": 0.5 if success else 2.5, "pressure_error": 0.05, "success": success}
            row |= {"reach_s": 2.0 if success else np.nan, "path_mm": 6.6, "geodesic_mm": 6.0}
            trials.append(row | {"lifted": number < lifted, "off_skin": False})
        for time in (1.0, 2.0):
            progress.append(keys | {"time_s": time, "median_mm": 2.0 / time, "within": hits / 12})
        if variant in (TEXT, ACTING):
            for time in range(6):
                place = dict(zip(("x_m", "y_m", "z_m"), SKIN.surface(-0.01 + 0.001 * time, 0.0), strict=True))
                paths.append(keys | {"seed": 0, "trial": 0, "time_s": time} | place | {"load_n": 1.0})
    return {
        name: pd.DataFrame(rows)
        for name, rows in (("trials", trials), ("progress", progress), ("paths", paths))
    }


def skin_tables(reached):
    """The same tables of two skins; trials of the first have the successes that are asked for."""
    skins = {"sphere": reached, "flat_pad": 12}
    parts = []
    for name, hits in skins.items():
        trials = loop_tables({ACTING: hits})["trials"]
        chosen = trials[trials["structure"] & trials["with_loss"] & (trials["horizon"] == 1)]
        tables = {"latent": latent_table(), "directions": direction_table()}
        tables["trials"] = chosen[chosen["change"] == ""]
        parts.append({key: table.assign(skin=name) for key, table in tables.items()})
    return {key: pd.concat([part[key] for part in parts], ignore_index=True) for key in parts[0]}


def other_skins(reached=10):
    parameters, servo = OtherSkinsParameters(), ServoTrialParameters()
    return OtherSkins(**skin_tables(reached), parameters=parameters, servo=servo)


def servo_loop(reached=None, lifted=0):
    return ServoLoop(**loop_tables(reached, lifted), parameters=ServoTrialParameters())


@pytest.fixture(scope="module")
def results():
    rng = np.random.default_rng(0)
    dataset = toy_dataset()
    along, across = rng.uniform(-0.012, -0.004, len(dataset)), rng.uniform(-0.006, 0.006, len(dataset))
    dataset = replace(dataset, contact_point=SKIN.surface(along, across), motion=dataset.contact % 2)
    true = SKIN.surface(along - SHIFT_M, across)
    truth = pd.DataFrame({"trial": [f"t_{number}" for number in dataset.trial], "time_s": dataset.time})
    truth[["x_m", "y_m", "z_m"]] = true
    turn = np.array([[0.0, 1.0], [1.0, 0.0]])  # a mirror image
    flat = 1e2 * np.stack([along, across], axis=1) @ turn + 0.3
    latent_map = pd.DataFrame(
        {"x": flat[:, 0], "y": flat[:, 1], "z": dataset.pressure, "split": dataset.split}
    )
    latent_map["electrode"] = dataset.signals.argmin(axis=1) + 1
    return ServoingResults(
        dataset=dataset,
        truth=truth,
        latent=latent_table(),
        forward=forward_table(),
        directions=direction_table(),
        curve=curve_table(),
        latent_map=latent_map,
        loop=servo_loop({ACTING: 12, replace(ACTING, structure=False): 6, replace(ACTING, inverse="LL"): 12}),
        other_skins=other_skins(),
        person=ToucherParameters(),
        preparation=TouchDataParameters(),
        geodesics=GeodesicParameters(bin_size=1000),
        learned=LatentParameters(seeds=SEEDS),
    )


@pytest.fixture(scope="module")
def drawn(results):
    return pictures(results)


def page(results):
    links = [Link("../recordings/servoing/servo.rrd", "servo.rrd")]
    return render(servoing_page(results, {}, {"toucher": results.person}, links))


def verdicts(results):
    return {row[0]: row[3] for row in servoing_claims(results)}


def text_of(html):
    return re.sub(r"<style>.*?</style>", "", html, flags=re.DOTALL)


def test_page_shows_every_figure_and_links_only_tables_that_are_written(results, drawn):
    html = page(results)
    assert set(re.findall(r'<img src="figures/(\w+)\.png"', html)) == set(drawn)
    assert set(re.findall(r'href="tables/(\w+)\.csv"', html)) <= set(tables(results))
    assert 'href="../recordings/servoing/servo.rrd"' in html
    assert not re.search(r'(src|href)="(https?:)?//', html)


def test_page_says_that_it_is_simulated_and_is_the_same_every_time(results):
    html = page(results)
    assert re.search(r"<h1>[^\n]*badge", html)
    assert "on this page are simulated" in html
    assert html == page(results)
    assert not re.search(r"\bnan\b", text_of(html).lower())


def test_of_recorded_demonstrations_neither_true_contacts_nor_closed_loops_are_shown(results, tmp_path):
    dataset = replace(results.dataset, motion=np.full(len(results.dataset), OTHER))
    recorded = replace(results, dataset=dataset, truth=results.truth.iloc[:0], loop=None)
    html = page(recorded)
    assert set(re.findall(r'<img src="figures/(\w+)\.png"', html)) == set(pictures(recorded))
    assert set(pictures(recorded)) == {"map", "curve", "forward", "directions"}
    assert set(re.findall(r'href="tables/(\w+)\.csv"', html)) <= set(tables(recorded))
    assert not {"closed loop", "resting"} & set(verdicts(recorded))
    assert "Closed loop</h2>" not in html
    values = metrics(recorded)
    write_metrics(values, tmp_path / "metrics.json")
    assert values["simulated"] is False
    assert not [name for name in values if name.startswith(("servo_", "contact_point"))]
    own, others = html.split(">Other skins")[-2:]  # a link above, the heading of the section
    assert not re.search("simulat", text_of(own), flags=re.IGNORECASE)
    assert 'class="badge"' in others  # these fingers are simulated whoever recorded
    assert test_chains(recorded)["motion"].tolist() == ["any motion"]


def test_other_skins_are_told_with_their_intervals(results):
    html = page(results)
    assert "83.3 % [55.2, 95.3] of 12 targets with the sphere" in html
    assert "100.0 % [75.8, 100.0] of 12 targets with the flat pad" in html
    assert "2 that miss" in html
    assert metrics(results)["servo_success_rate_sphere"] == pytest.approx(10 / 12)
    statement = "The method does not assume a geometry of the skin"
    assert verdicts(results)[statement] == "yes"
    assert verdicts(replace(results, other_skins=other_skins(reached=6)))[statement] == "undecided"
    assert verdicts(replace(results, other_skins=other_skins(reached=2)))[statement] == "no"
    learned = tables(results)["other_skins"].set_index("skin")
    assert learned.loc["flat_pad", "reconstruction"] == pytest.approx(0.05)
    assert learned.loc["sphere", "NJ_linear"] == pytest.approx(0.15)


def test_medians_of_few_successes_are_not_shown(results):
    few = shown(servo_loop({ACTING: 8}), [ACTING, TEXT])
    assert few[["reach_s", "path_ratio"]].isna().all(axis=None)
    many = shown(servo_loop({ACTING: 12}), [ACTING])
    assert many["reach_s"].item() == 2.0


def test_pictures_are_the_same_every_time_and_small(results, drawn, tmp_path):
    save(drawn["forward"], tmp_path / "first.png")
    save(forward_figure(results), tmp_path / "second.png")
    first = (tmp_path / "first.png").read_bytes()
    assert first == (tmp_path / "second.png").read_bytes()
    assert len(first) < 200_000


def test_contact_errors_are_distances_between_estimate_and_truth(results):
    errors = results.contact_errors
    np.testing.assert_allclose(errors["error_mm"], 1e3 * SHIFT_M, rtol=1e-4)
    np.testing.assert_allclose(errors["along_mm"], 1e3 * SHIFT_M, rtol=1e-4)
    np.testing.assert_allclose(errors["across_mm"], 0.0, atol=1e-4)
    assert metrics(results)["contact_point_error_mm"] == pytest.approx(1.0, rel=1e-4)
    squares = results.contact_bias  # all of the error is the same everywhere
    assert squares["squared_mm2"].sum() == pytest.approx(len(errors), rel=1e-3)
    assert squares["samples"].sum() == len(errors)


def test_truth_is_found_by_trial_and_time_not_by_order(results):
    shuffled = results.truth.sort_values("time_s", kind="stable")  # trials keep their order of appearance
    np.testing.assert_array_equal(replace(results, truth=shuffled).contact_errors, results.contact_errors)


def test_map_is_laid_onto_the_skin(results):
    np.testing.assert_allclose(results.map_on_skin, results.places, atol=1e-3)


def test_tables_are_means_over_seeds(results):
    table = latent(results).set_index(["space", "split"])
    assert table.loc[("structure", "test"), "reconstruction"] == pytest.approx(0.05)
    assert table.loc[("structure", "test"), "distances_worst"] == pytest.approx(0.005 * 1.02)
    models = forward_at_test(results).set_index("model")
    assert models.loc["NL with NJ's loss", "structure"] == pytest.approx(0.2)
    assert models.loc["NL", "none_relative"] == pytest.approx(0.1 / 0.15)
    rows = directions(results).set_index(["inverse", "loss", "space"])
    assert rows.loc[("NJ", True, "structure"), "encoder"] == pytest.approx(0.1)
    assert rows.loc[("NJ", True, "structure"), "encoder_linear"] == pytest.approx(0.15)


def test_chains_that_are_tested_are_counted_by_motion(results):
    table = test_chains(results)
    assert table["chains"].sum() == len(results.tested)
    assert table["contacts"].sum() == 3  # of 30 contacts, those with 7 as last digit
    assert table["chains"].tolist() == [0, 3 * (400 - 8 * 31)]


def test_metrics_are_flat_and_of_the_named_models(results, tmp_path):
    values = metrics(results)
    write_metrics(values, tmp_path / "metrics.json")  # raises on NaN
    assert json.loads((tmp_path / "metrics.json").read_text()).keys() == values.keys()
    assert values["reconstruction_nmse_test"] == pytest.approx(0.05)
    assert values["mds_nmse_test"] == pytest.approx(0.005)
    assert values["forward_nmse_chain3_struct"] == pytest.approx(0.2)
    assert values["forward_nmse_chain3_nostruct"] == pytest.approx(0.1)
    assert values["cosine_distance_nj"] == pytest.approx(0.1)
    assert values["cosine_distance_ll"] == values["cosine_distance_ng"] == pytest.approx(0.3)
    assert values["simulated"] is True


def test_bounds_hold_for_every_seed_and_split(results):
    statement = "The autoencoder's reconstruction NMSE is below 0.25 in all splits"
    assert verdicts(results)[statement] == "yes"
    table = latent_table()
    table.loc[table.index[table["split"] == "validation"][2], "reconstruction"] = 0.26
    assert verdicts(replace(results, latent=table))[statement] == "no"
    statement = "Map distances against geodesics have an NMSE below 0.02 in all splits"
    assert verdicts(results)[statement] == "yes"
    assert verdicts(replace(results, latent=latent_table(distances=0.021)))[statement] == "no"


def test_claims_on_structure_follow_the_numbers(results):
    lowers = "Structure in the latent space lowers forward NMSE in every case"
    relative = "\N{HORIZONTAL ELLIPSIS} relative to the prediction that nothing moves"
    assert verdicts(results)[lowers] == "no"
    assert verdicts(results)[relative] == "yes"  # a third of what nothing moves has, against two thirds
    assert "it is the opposite here" in page(results)
    swapped = replace(results, forward=forward_table(with_structure=0.1, without=0.2))
    assert verdicts(swapped)[lowers] == "yes"
    assert "it is the opposite here" not in page(swapped)
    assert verdicts(replace(results, forward=forward_table(0.1, 0.1)))[lowers] == "undecided"


def test_a_statement_that_holds_for_some_models_names_them(results):
    table = forward_table()
    mask = (table["trained_with"] == "NG") & table["structure"]
    table.loc[mask, "nmse"] *= 1.5
    word = verdicts(replace(results, forward=table))["The inverse model's loss raises forward NMSE somewhat"]
    assert word == "undecided: LL with LL's loss and NL with NJ's loss; yes: NL with NG's loss"


def test_claims_on_inverse_models_follow_the_numbers(results):
    best = "The network's Jacobian (NJ) is the best inverse model"
    away = "Without that loss a model does not provide correct actions: they point the wrong way"
    assert verdicts(results)[best] == "yes"
    assert verdicts(results)[away] == "no"
    assert verdicts(replace(results, directions=direction_table(best="LL")))[best] != "yes"
    assert verdicts(replace(results, directions=direction_table(without_loss=1.3)))[away] == "yes"


def test_steps_until_a_bound_holds(results):
    assert results.steps_until("reconstruction", 0.25) == 100
    assert results.steps_until("distances", 0.02) == 200
    assert results.steps_until("distances", 0.001) is None


def test_choices_that_saw_test_figures_are_told(results):
    html = page(results)
    assert "first on test figures" in html
    assert "NJ was best in three of the five" in html
    assert "120 configurations" in html
    assert "no finding" in html
    assert "half a cosine" in html


def test_closed_loops_are_counted_with_their_intervals(results):
    row = results.loop.table().set_index(["form", "inverse", "structure", "with_loss", "horizon", "change"])
    own = row.loc[("resting", "NJ", True, True, 1, "")]
    assert own["trials"] == 12
    assert own["rate"] == own["rate_mixed"] == 1.0
    assert own["low"] == pytest.approx(0.7575, abs=1e-4)  # Wilson for 12 of 12: 1 / (1 + 1.96^2 / 12)
    assert own["path_ratio"] == pytest.approx(1.1)
    assert own["reach_s"] == 2.0
    values = metrics(results)
    assert values["servo_success_rate"] == 1.0
    assert values["servo_success_rate_published"] == 0.0
    assert values["servo_success_rate_nostruct"] == 0.5
    assert values["servo_contacts_lost"] == 0


def test_without_any_success_there_is_a_page(results, tmp_path):
    nothing = replace(results, loop=servo_loop())
    assert not re.search(r"\bnan\b", text_of(page(nothing)).lower())
    write_metrics(metrics(nothing), tmp_path / "metrics.json")
    assert set(pictures(nothing)) == set(pictures(results))


def test_claims_on_closed_loops_follow_the_numbers(results):
    found = verdicts(results)
    published = next(name for name in found if name.endswith("as published"))
    resting = next(name for name in found if name.startswith("95 %") and name.endswith("resting controller"))
    stays = next(name for name in found if "never lost" in name)
    structure = "Structure in the latent space is critical to success"
    reaches = "The non-linear model and NJ produce the motions that bring a contact to its target"
    assert found[published] == found[reaches] == "no"
    assert found[resting] == "undecided"  # twelve of twelve are too few to say 95 %
    assert found[stays] == "yes"
    assert found[structure] == "yes: LL and NJ; undecided: NG"
    other = verdicts(replace(results, loop=servo_loop({TEXT: 12, ACTING: 4}, lifted=1)))
    assert other[reaches] == "yes"
    assert other[resting] == "no"
    assert other[stays] == "no"
