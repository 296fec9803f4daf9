"""The page of the servoing testbed, on a toy finger and tables whose numbers are known."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import reporting_verdicts
import yaml
from committed import ROOT, committed
from tactile_toy import toy_dataset

from dissertation.evidence.results import Population as Joined
from dissertation.evidence.results import Results
from dissertation.evidence.studies import Study, StudyProvenance, digests
from dissertation.servoing.names import AS_PUBLISHED, DYNAMICS, OURS, STILL
from dissertation.servoing.page import page
from dissertation.servoing.page.findings import AS_PUBLISHED_LL, findings, register
from dissertation.servoing.page.shown import Shown
from dissertation.servoing.protocol.results import contacts, servoing_results
from dissertation.servoing.protocol.servo_trials import MOTIONS
from dissertation.servoing.protocol.servo_variants import (
    OtherSkinsParameters,
    ServoTrialParameters,
    variants,
)
from dissertation.simulation.fingers import PinchParameters
from dissertation.simulation.touch import TouchFingerParameters
from dissertation.simulation.touch_demonstrator import ToucherParameters
from structlearn.core.params import Population
from structlearn.core.rates import rate_interval
from structlearn.reporting.document import render
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
    "touch_finger": committed(TouchFingerParameters, "touch_finger"),
    "testbed.touch": committed(PinchParameters, "testbed.touch"),
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


def models():
    """Tables of `LatentComparison`, but the map."""
    tables = {"latent": latent_table(), "forward": forward_table(), "decoded": decoded_table()}
    return tables | {"directions": direction_table(), "curve": curve_table()}


def loops(reached=None, elsewhere=None):
    """Closed loops, with the sphere and the flat pad too."""
    skins = [comparison(elsewhere)["trials"].assign(skin=name) for name in ("sphere", "flat_pad")]
    return comparison(reached) | {"other_skins": pd.concat(skins, ignore_index=True)}


def truth(pace=1.0, load_n=1.0):
    """True contacts of two demonstrations: one of 5 s, in which the finger slackens, and two of 2 s."""
    parts = []
    for trial, times in (("rotation_1_1", [(1.0, 6.0)]), ("translation_12_3", [(1.0, 3.0), (4.5, 6.5)])):
        time = np.arange(0.0, 8.0, 0.01)
        touched = np.any([(time >= first - 1e-9) & (time <= last + 1e-9) for first, last in times], axis=0)
        load = load_n * touched * (np.abs(time - 1.8) > 0.1)
        parts.append(pd.DataFrame({"trial": trial, "time_s": pace * time, "load_n": load}))
    return pd.concat(parts, ignore_index=True)


def people(reached=None, elsewhere=None, count=4):
    """Table of results of people whose values are spread about the same ones, with the same trials."""
    one = servoing_results(0, 1.0, truth(), models(), loops(reached, elsewhere))
    tables = [one.assign(person=person) for person in range(count)]
    for person, table in enumerate(tables):
        spread_out = table["quantity"].str.contains("nmse|cosine")
        table["value"] *= np.where(spread_out, 1.0 + WOBBLE[person], 1.0)
    return pd.concat(tables, ignore_index=True)


def found(table):
    """Findings on a table of results."""
    find, results = Findings(), Results(table, "person")
    register.evaluate(find, Joined(results, results, None))
    return find


def verdicts(table):
    return reporting_verdicts.verdicts("dissertation.servoing.page", found(table))


WORKS = dict.fromkeys(variants(CHOSEN["servo"].horizon), 12)
CRITICAL = {one: 12 * (one.structure and one.with_loss) for one in WORKS}  # structure and loss
HARMFUL = {one: 12 - reached for one, reached in CRITICAL.items()}


@pytest.fixture(scope="module")
def shown():
    rng = np.random.default_rng(0)
    dataset = toy_dataset()
    along, across = rng.uniform(-0.012, -0.004, len(dataset)), rng.uniform(-0.006, 0.006, len(dataset))
    dataset = replace(dataset, contact_point=SKIN.surface(along, across), motion=dataset.contact % 2)
    truth = pd.DataFrame({"trial": [f"t_{number}" for number in dataset.trial], "time_s": dataset.time})
    truth[["x_m", "y_m", "z_m"]] = SKIN.surface(along - SHIFT_M, across)
    mirrored = 1e2 * np.stack([across, along], axis=1) + 0.3
    latent_map = pd.DataFrame({"x": mirrored[:, 0], "y": mirrored[:, 1], "z": dataset.pressure})
    latent_map["electrode"] = dataset.signals.argmin(axis=1) + 1
    other = {key: table.assign(skin="sphere") for key, table in models().items()}
    reached = {OURS: 12, replace(OURS, structure=False): 6}
    return Shown(dataset, truth, models() | {"latent_map": latent_map}, loops(reached), other, CHOSEN)


def test_results_are_means_over_models_and_sums_over_targets():
    table = Results(people({OURS: 6}, count=1), "person")
    keys = {"space": "structure", "model": "NJ", "loss": "NJ"}
    assert table.each("distances_nmse", space="structure", split="test")[0] == pytest.approx(0.005 * 0.98)
    cosine = table.each("cosine_distance", **keys, target="followed")[0]
    assert cosine == pytest.approx(0.1 * 0.98)
    loop = keys | {"controller": "adaptive", "change": "", "steps": 1, "skin": "own"}
    assert table.each("reached", **loop, target="all")[0] == 6
    assert table.each("reached", **loop, target="mixed")[0] == 2
    assert table.each("trials", **loop, target="mixed")[0] == 4
    assert table.each("lost", **loop, target="all")[0] == 0


def test_contacts_are_found_in_the_truth_and_their_variance_between_people():
    table = contacts(truth(load_n=2.0))
    assert table["motion"].tolist() == ["rotation", "translation", "translation"]
    assert table["area"].tolist() == ["1", "12", "12"]
    np.testing.assert_allclose(table["contact_s"], [5.0, 2.0, 2.0])
    np.testing.assert_allclose(table["contact_n"], 2.0)
    rng, tables = np.random.default_rng(0), []
    for person in range(6):
        parts = []
        for repeat in range(20):
            pace = np.exp(0.1 * person + 0.01 * rng.standard_normal())
            one = truth(pace, np.exp(rng.standard_normal()))
            parts.append(one.assign(trial=one["trial"].str[:-1] + str(repeat)))
        tables.append(servoing_results(person, 1.0, pd.concat(parts), models(), loops({OURS: 6})))
    shares = found(pd.concat(tables, ignore_index=True))["between_people"]
    assert shares["time"].low > 0.95
    assert shares["load"].low < 0.1
    assert shares["error"].value == 0.0  # all have the same trials


def test_claims_on_predictions_hold_where_numbers_say_so():
    yes = verdicts(people())
    decided = ("people_reconstruction_nmse", "people_mds_nmse", "grows", "nj_predicts", "loss_directs")
    assert {yes[name] for name in (*decided, "easier", "loss_needed", "structure_predicts_pressure")} == {
        "yes"
    }
    assert yes["structure_predicts"] == yes["loss_predicts"] == "no"  # the latter is equal for every person


CONTROLLERS = [f"people_servo_success_rate{ending}" for ending in ("", "_published", "_ll_published")]


def test_a_failing_controller_is_compared_with_itself_on_other_skins():
    few = dict.fromkeys(WORKS, 2)
    none = verdicts(people(few, few))
    assert {none[name] for name in (*CONTROLLERS, "geometry_aimed")} == {"no"}
    half = {AS_PUBLISHED: 6, AS_PUBLISHED_LL: 6}
    assert verdicts(people(half, WORKS))["geometry"] == "yes"
    assert verdicts(people(half))["geometry"] == verdicts(people(half))["geometry_ll"] == "no"


def test_what_lacks_something_is_compared_over_all_inverse_models():
    better = found(people(CRITICAL))
    for name in ("structure_serves", "structure_serves_adaptive", "loss_serves"):
        assert better[name].value == 100.0
        assert better[name].n == 4
    assert found(people(WORKS))["structure_serves"].value == 0.0


@pytest.fixture
def study(tmp_path, monkeypatch):
    """A study of four people with the committed parameters, in a project whose parameters can be changed."""
    values = yaml.safe_load((ROOT / "params.yaml").read_text())
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dvc.yaml").write_text((ROOT / "dvc.yaml").read_text())

    def made(**servo):
        (tmp_path / "params.yaml").write_text(yaml.safe_dump(values | {"servo": values["servo"] | servo}))
        keys = ["servo", "train_latent", "toucher"]
        provenance = StudyProvenance(parameters=digests(values, keys, []), seeds=[], cells={}, check=None)
        return Study(people(WORKS).assign(variant="ours", cell="1"), provenance)

    return made


def test_a_changed_controller_leaves_what_was_found_on_models(study):
    own = people({OURS: 6}, count=1).assign(person=9)
    whole = findings(own, study())
    assert whole["people_servo_success_rate"].people == whole["people"].value == 4
    assert not whole["people_servo_success_rate"].remark
    moved = findings(own, study(duration_s=4.0))
    assert moved["people_mds_nmse"] == whole["people_mds_nmse"]
    rate = moved["people_servo_success_rate"]
    assert rate.value == 0.5
    assert rate.remark.startswith("one person; ")
    assert rate.remark.endswith("with other parameters")
    before, after = (reporting_verdicts.verdicts("dissertation.servoing.page", its) for its in (whole, moved))
    assert {name for name in before if before[name] != after[name]} <= {
        name for name, its in moved.items() if "one person" in str(its)
    }


@pytest.mark.parametrize("studied", [False, True])
def test_the_page_says_what_its_verdicts_rest_on_and_on_which_contacts_models_were_tested(
    shown, study, studied
):
    its = study() if studied else None
    text = render(page.document(shown, findings(people(count=1), its), its), reporting_verdicts.AnyFigure())
    assert ("rest on the study servoing/people, made by unknown code, not repeated since." in text) == studied
    assert ("(one person)" in text) != studied
    assert "Batch normalisation" in text  # which was not tested
    count = 3 * (400 - 3 * 31)  # of 30 contacts, those with 7 as last digit
    assert f"(0 in 0 contacts of rotation, {count} in 3 contacts of translation)" in text


def test_contact_errors_are_distances_between_estimate_and_truth(shown):
    shuffled = shown.truth.sort_values("time_s", kind="stable")  # trials keep their order of appearance
    its = replace(shown, truth=shuffled)
    errors = its.contact_errors
    np.testing.assert_allclose(shown.map_on_skin, shown.places, atol=1e-3)
    np.testing.assert_allclose(errors["error_mm"], 1e3 * SHIFT_M, rtol=1e-4)
    np.testing.assert_allclose(errors["along_mm"], 1e3 * SHIFT_M, rtol=1e-4)
    np.testing.assert_allclose(errors["across_mm"], 0.0, atol=1e-4)
    assert its.fixed_share == pytest.approx(1.0, rel=1e-3)  # all of the error is the same everywhere
    assert its.contact_bias["samples"].sum() == len(errors)


def test_tables_are_averages_over_seeds(shown):
    near = {"rel": 1e-3}  # a geometric mean of values spread by 2 %
    latent = page.latent_table(shown.models["latent"]).set_index(["space", "split"])
    assert latent.loc[("structure", "test"), "reconstruction"] == pytest.approx(0.05, **near)
    assert latent.loc[("structure", "test"), "distances_worst"] == pytest.approx(0.005 * 1.02)
    forward = page.forward_table(shown).set_index(["space", "model", "loss", "steps"])
    assert forward.loc[("structure", "NL", "NJ", 3), "nmse"] == pytest.approx(0.2, **near)
    assert forward.loc[("no structure", "NL", "none", 3), "relative"] == pytest.approx(0.1 / 0.15)
    directions = page.direction_table(shown).set_index(["space", "model", "loss"])
    assert directions.loc[("structure", "NJ", "NJ"), "followed"] == pytest.approx(0.1)
    assert directions.loc[("structure", "NJ", "NJ"), "linear"] == pytest.approx(0.15)
    assert page.skin_table(shown).set_index("skin").loc["sphere", "NJ_linear"] == pytest.approx(0.15)


def test_controllers_are_counted_with_their_intervals(shown):
    table = page.loop_table(shown.trials).query("skin == 'own'").set_index(page.CONTROLLER)
    ours = table.loc[tuple(page.controller_keys(OURS).values())]
    assert ours["rate"] == ours["mixed"] == 1.0
    assert ours["low"] == pytest.approx(rate_interval([6, 6], [6, 6])[0])  # 12 of 12, but of two models
    assert ours["path_ratio"] == pytest.approx(1.1)
    assert ours["reach_s"] == 2.0
