"""The page of the servoing testbed, on a toy finger and tables whose numbers are known."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import reporting_verdicts
from committed import committed
from tactile_toy import toy_dataset

from dissertation.evidence.claims import claims_table
from dissertation.evidence.studies import OURS as STUDIED
from dissertation.evidence.studies import Study
from dissertation.servoing.names import AS_PUBLISHED, DYNAMICS, OURS, STILL
from dissertation.servoing.page import page
from dissertation.servoing.page.findings import (
    AS_PUBLISHED_LL,
    ModelScores,
    ServoingResults,
    contact_bias,
    findings,
    forward_case,
    over_people,
    rate_case,
    rated,
)
from dissertation.servoing.protocol.servo_trials import MOTIONS
from dissertation.servoing.protocol.servo_variants import (
    OtherSkinsParameters,
    ServoTrialParameters,
    variants,
)
from dissertation.simulation.touch_demonstrator import ToucherParameters
from structlearn.core.params import Population
from structlearn.core.rates import rate_interval
from structlearn.reporting.document import render
from structlearn.reporting.evidence import Evidence
from structlearn.reporting.findings import Findings
from structlearn.tactile.electrodes import SKINS
from structlearn.tactile.latent_parameters import GeodesicParameters, LatentParameters
from structlearn.tactile.touch_dataset import SPLITS, TouchDataParameters

SKIN = SKINS["biotac"]
SHIFT_M = 0.001
WOBBLE = 0.02 * np.array([-1.0, 1.0, -0.5, 0.5])
"""Relative deviations of the seeds, of mean zero."""

CHOSEN = {
    "toucher": committed(ToucherParameters, "toucher"),
    "touch_dataset": committed(TouchDataParameters, "touch_dataset"),
    "geodesics": committed(GeodesicParameters, "geodesics"),
    "train_latent": committed(LatentParameters, "train_latent", seeds=4),
    "servo": committed(ServoTrialParameters, "servo"),
    "other_skins": committed(OtherSkinsParameters, "other_skins"),
    "servo_people": committed(Population, "servo_people"),
}


def spread(value):
    return value * (1.0 + WOBBLE)


def over_seeds(rows):
    """A table of rows by column, each once per seed; numbers with a decimal point are spread over seeds."""
    return pd.DataFrame(
        {name: value * factor if isinstance(value, float) else value for name, value in row.items()}
        | {"seed": seed}
        for row in rows
        for seed, factor in enumerate(spread(1.0))
    )


def latent_table():
    return over_seeds(
        {"structure": structure, "split": split, "reconstruction": 0.05, "worst_electrode": 0.1}
        | {"distances": near, "pressure": 0.5 * near}
        for structure, near in ((True, 0.005), (False, 1.0))
        for split in SPLITS
    )


def forward_table(with_structure=0.2, without=0.1):
    """NMSE at three steps, in proportion elsewhere."""
    return over_seeds(
        {"structure": structure, "forward": kind, "trained_with": way, "steps": steps, "nmse": nmse}
        | {"plane": 0.5 * nmse, "third": 2.0 * nmse}
        for structure, error, nothing in ((True, with_structure, 0.6), (False, without, 0.15))
        for kind, way in (*DYNAMICS, STILL)
        for steps in (1, 2, 3)
        for nmse in [(nothing if (kind, way) == STILL else error) * steps / 3]
    )


def decoded_table():
    table = forward_table(0.5, 0.9).drop(columns=["plane", "third"])
    return table.rename(columns={"nmse": "pressure"}).assign(electrodes=0.3)


def direction_table():
    return over_seeds(
        {"structure": structure, "inverse": inverse, "trained_with": way, "comparison": comparison}
        | {"part": part, "distance": factor * share * value}
        for structure in (True, False)
        for inverse in ("LL", "NG", "NJ")
        for way, value in ((inverse, 0.1 if inverse == "NJ" else 0.3), ("none", 0.7))
        for comparison, factor in (("forward", 0.5), ("encoder", 1.0), ("agreement", 0.2))
        for part, share in (("translation", 1.5), ("rotation", 0.5))
    )


def curve_table():
    """Map distances fall below the published bound with the second point, reconstruction with the first."""
    quantities = {"reconstruction": (0.2, 0.1, 0.05), "distances": (0.03, 0.01, 0.005)}
    quantities["pressure"] = (0.1, 0.1, 0.1)
    quantities |= {f"forward {kind}-{way}": (0.4, 0.3, 0.2) for kind, way in DYNAMICS}
    quantities |= {f"direction {one}-{one}": (0.5, 0.3, 0.1) for one in ("LL", "NG", "NJ")}
    return over_seeds(
        {"structure": True, "quantity": name, "value": value, "step": step}
        for name, values in quantities.items()
        for step, value in zip((100, 200, 300), values, strict=True)
    )


def comparison(reached=None):
    """Trials of two seeds with six targets each, of which some are `reached` (even, by controller)."""
    trials, progress, paths = [], [], []
    for variant in variants(CHOSEN["servo"].horizon):
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
            trials.append(row | {"lifted": False, "off_skin": False})
        for time in (1.0, 2.0):
            near = {"median_mm": 2.0 / time, "upper_mm": 3.0 / time, "within": hits / 12}
            progress.append(keys | {"time_s": time} | near)
        if variant in (AS_PUBLISHED, OURS):
            for time in range(6):
                place = dict(zip(("x_m", "y_m", "z_m"), SKIN.surface(-0.01 + 0.001 * time, 0.0), strict=True))
                paths.append(keys | {"seed": 0, "trial": 0, "time_s": time} | place | {"load_n": 1.0})
    tables = {"trials": trials, "progress": progress, "paths": paths}
    return {name: pd.DataFrame(rows) for name, rows in tables.items()}


def skin_tables(published=0, ours=10):
    """Of two skins; so many of twelve targets are reached by the published controller and ours."""
    parts = []
    for name in ("sphere", "flat_pad"):
        found = {
            "latent": latent_table(),
            "directions": direction_table(),
            "trials": comparison({AS_PUBLISHED: published, OURS: ours})["trials"],
        }
        parts.append({key: table.assign(skin=name) for key, table in found.items()})
    return {key: pd.concat([part[key] for part in parts], ignore_index=True) for key in parts[0]}


@pytest.fixture(scope="module")
def results():
    rng = np.random.default_rng(0)
    dataset = toy_dataset()
    along, across = rng.uniform(-0.012, -0.004, len(dataset)), rng.uniform(-0.006, 0.006, len(dataset))
    dataset = replace(dataset, contact_point=SKIN.surface(along, across), motion=dataset.contact % 2)
    truth = pd.DataFrame({"trial": [f"t_{number}" for number in dataset.trial], "time_s": dataset.time})
    truth[["x_m", "y_m", "z_m"]] = SKIN.surface(along - SHIFT_M, across)
    mirrored = 1e2 * np.stack([across, along], axis=1) + 0.3
    latent_map = pd.DataFrame({"x": mirrored[:, 0], "y": mirrored[:, 1], "z": dataset.pressure})
    latent_map["electrode"] = dataset.signals.argmin(axis=1) + 1
    parts = latent_table(), forward_table(), decoded_table(), direction_table(), curve_table()
    models = ModelScores(*parts, latent_map)
    reached = {OURS: 12, replace(OURS, structure=False): 6, replace(OURS, inverse="LL"): 12}
    return ServoingResults(dataset, truth, models, comparison(reached), skin_tables(), CHOSEN, None)


@pytest.fixture(scope="module")
def shown(results):
    return page.tables(results)


@pytest.fixture
def document(shown, monkeypatch):
    """Makes the page; its tables are those of the same models, whoever was studied."""
    monkeypatch.setattr(page, "tables", lambda _: shown)
    return page.document


def with_people(results, table, times=1):
    """Numbers of four people, so many times, spread about those of `table` where it has one for all."""
    columns = {key: spread(value) if np.isscalar(value) else value for key, value in table.items()}
    numbers = pd.concat([pd.DataFrame(columns)] * times, ignore_index=True)
    whole = pd.DataFrame({"variant": STUDIED, "cell": range(len(numbers))})
    return replace(results, study=Study({"findings": pd.concat([whole, numbers], axis=1)}))


def predictions():
    """Numbers of which all that the text says of predictions follows, but that structure helps them."""
    found = {f"reconstruction_nmse_{split}": 0.05 for split in SPLITS}
    found |= {f"mds_nmse_{split}": 0.005 for split in SPLITS}
    for structure, error, pressure in ((True, 0.2, 0.5), (False, 0.1, 0.9)):
        for kind in DYNAMICS:
            for steps in (1, 2, 3):
                found[f"forward_nmse_{forward_case(*kind, structure, steps)}"] = error * steps / 3
            found[f"forward_nmse_{forward_case(*kind, structure, column='pressure')}"] = pressure
    cosines = {f"cosine_distance_{name}": 0.1 if name == "nj" else 0.3 for name in ("ll", "ng", "nj")}
    found |= cosines | {f"{key}_predicted": 0.5 * value for key, value in cosines.items()}
    return found | {"cosine_distance_nj_without_loss": 0.7}


def loops(default=0.1, lost=0, **rates):
    """Shares by metric, with a skin's name before it; others have the default. Spread over people."""
    cases = [rate_case(one) for one in rated()]
    shown = (AS_PUBLISHED, AS_PUBLISHED_LL, OURS)
    cases += [rate_case(one, skin) for skin in ("sphere", "flat_pad") for one in shown]
    found = {f"servo_success_rate_{case}".strip("_"): rates.get(case or "ours", default) for case in cases}
    return {key: np.minimum(spread(value), 1.0) for key, value in found.items()} | {
        "servo_contacts_lost": np.full(4, lost)
    }


def everything(**changes):
    return predictions() | loops() | changes


CONTROLLERS = [f"people_servo_success_rate{ending}" for ending in ("", "_published", "_ll_published")]


def verdicts(results):
    find = Findings()
    over_people(find, results)
    return reporting_verdicts.verdicts("dissertation.servoing.page", find)


def test_claims_on_predictions_hold_where_numbers_say_so(results):
    yes = verdicts(with_people(results, everything()))
    decided = ("people_reconstruction_nmse", "people_mds_nmse", "grows", "nj_predicts", "loss_directs")
    assert {yes[name] for name in (*decided, "easier", "structure_predicts_pressure")} == {"yes"}
    assert yes["structure_predicts"] == yes["loss_predicts"] == "no"  # the latter is equal for every person


def test_controllers_that_fail_say_nothing_of_what_they_would_need(results):
    found = verdicts(with_people(results, everything()))
    assert {found[name] for name in CONTROLLERS} == {"no"}  # each reaches one in ten
    gated = ("loss_needed", "loss_needed_ll", "geometry", "geometry_ll")
    assert {found[name] for name in gated} == {"not tested"}  # so nothing follows from its failing
    assert found["geometry_aimed"] == "no"
    works = {"ours": 1.0, "published": 0.9, "ll_published": 0.9, "ll": 0.9, "ng": 0.9, "ng_published": 0.9}
    skins = {
        f"{skin}{end}": 0.97 for skin in ("sphere", "flat_pad") for end in ("", "_published", "_ll_published")
    }
    better = verdicts(with_people(results, everything(**loops(**works, **skins)), times=10))
    good = (*CONTROLLERS, "people_servo_contacts_lost", *gated, "geometry_aimed")
    assert {better[name] for name in good} == {"yes"}
    assert better["structure_serves"] == better["structure_serves_resting"] == better["loss_serves"] == "yes"


@pytest.mark.parametrize("studied", [False, True])
def test_the_page_says_what_its_verdicts_rest_on_and_on_which_contacts_models_were_tested(
    results, document, studied
):
    results = with_people(results, everything()) if studied else results
    text = render(document(results, findings(results)), reporting_verdicts.AnyFigure())
    assert ("rest on the study servoing/people, made by unknown code, not repeated since." in text) == studied
    count = 3 * (400 - 3 * 31)  # of 30 contacts, those with 7 as last digit
    assert f"(0 in 0 contacts of rotation, {count} in 3 contacts of translation)" in text


def test_rows_say_that_they_are_quoted_and_none_repeats_the_numbers_of_another(results, document):
    rng = np.random.default_rng(0)
    found = with_people(results, {key: rng.uniform(0.6, 0.9, 40) for key in everything()})
    rows = findings(found)
    judged = document(found, rows).judged
    assert set(claims_table(judged)["study"]) == {"servoing/people"}
    its = [rows[one.claim.evidence] for one in judged]
    values = [case.value for one in its for case in ([one] if isinstance(one, Evidence) else one.values())]
    assert len(set(values)) == len(values) == sum(len(one.cases) for one in judged)


def test_contact_errors_are_distances_between_estimate_and_truth(results):
    shuffled = results.truth.sort_values("time_s", kind="stable")  # trials keep their order of appearance
    errors = replace(results, truth=shuffled).contact_errors
    np.testing.assert_allclose(results.map_on_skin, results.places, atol=1e-3)
    np.testing.assert_allclose(errors["error_mm"], 1e3 * SHIFT_M, rtol=1e-4)
    np.testing.assert_allclose(errors["along_mm"], 1e3 * SHIFT_M, rtol=1e-4)
    np.testing.assert_allclose(errors["across_mm"], 0.0, atol=1e-4)
    squares = contact_bias(errors)  # all of the error is the same everywhere
    assert squares["squared_mm2"].sum() == pytest.approx(len(errors), rel=1e-3)
    assert squares["samples"].sum() == len(errors)


def test_tables_are_means_over_seeds(results):
    latent = page.latent_table(results.models).set_index(["space", "split"])
    assert latent.loc[("structure", "test"), "reconstruction"] == pytest.approx(0.05)
    assert latent.loc[("structure", "test"), "distances_worst"] == pytest.approx(0.005 * 1.02)
    forward = page.forward_table(results.models).set_index(["model", "space", "steps"])
    assert forward.loc[("NL with NJ's loss", "structure", 3), "nmse"] == pytest.approx(0.2)
    assert forward.loc[("NL", "no structure", 3), "relative"] == pytest.approx(0.1 / 0.15)
    directions = page.direction_table(results.models).set_index(["inverse", "loss", "space"])
    assert directions.loc[("NJ", True, "structure"), "encoder"] == pytest.approx(0.1)
    assert directions.loc[("NJ", True, "structure"), "encoder_linear"] == pytest.approx(0.15)
    skins = page.skin_table(results).set_index("skin")
    assert skins.loc["sphere", "NJ_linear"] == pytest.approx(0.15)


def test_controllers_are_counted_with_their_intervals(results):
    ours = page.loop_table(results.trials).set_index(list(vars(OURS))).loc[tuple(vars(OURS).values())]
    assert ours["rate"] == ours["rate_mixed"] == 1.0
    assert ours["low"] == pytest.approx(rate_interval(np.full(2, 6), np.full(2, 6))[0])  # of two models
    assert ours["path_ratio"] == pytest.approx(1.1)
    assert ours["reach_s"] == 2.0
    assert results.models.steps_until("reconstruction", 0.25) == 100
    assert results.models.steps_until("distances", 0.001) is None
    values = findings(results).numbers()
    assert values["servo_success_rate_nostruct"] == 0.5
    assert values["servo_success_rate_published"] == values["servo_contacts_lost"] == 0
    assert values["cosine_distance_nj"] == pytest.approx(0.1)
    assert values["forward_nmse_chain3_nostruct"] == pytest.approx(0.1)
