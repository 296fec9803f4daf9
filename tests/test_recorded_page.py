"""The pages of recorded data: every claim can say yes and no, and what is shown is there."""

from dataclasses import replace
from functools import lru_cache
from importlib.resources import files as package_files
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from conftest import two_move_demonstration
from reporting_verdicts import AnyFigure, verdicts
from test_recorded_boxes_page import PARAMETERS as BOXES_PARAMETERS
from test_recorded_boxes_page import made_up as past_boxes
from test_recorded_skin import SMALL as SKIN_PARAMETERS
from test_recorded_skin import made_up as on_skin
from test_recorded_touch_statistics import PARAMETERS, calibrated, traces
from test_recorded_ur10e import PARAMETERS as UR10E_PARAMETERS
from test_recorded_ur10e import made_up as weighed

from structlearn.core.params import read_parameters
from structlearn.primitives import sequence
from structlearn.primitives.fitting import FitParameters, learn_primitive, segment_paths, whole
from structlearn.reporting.claims import BY_CONSTRUCTION, claims_table, read_claims, verdict_in
from structlearn.reporting.document import anchor, render, words_in_view
from structlearn.reporting.findings import read_findings, values_by_key
from structlearn.reporting.publishing import publish_report
from structlearn.rigid_body.arm_identification import LEAST_SQUARES, URDF
from structlearn.segmentation.alignment import METHODS
from structlearn.tasks.public import public_names
from structlearn.tasks.public.page import assembly, calibration_figures, calibration_results, parts
from structlearn.tasks.public.page.parts import (
    avoidance_part,
    higher_reaches_part,
    reaches_part,
    slides_part,
    touch_part,
)
from structlearn.tasks.public.page.recorded_results import AXES, RecordedResults
from structlearn.tasks.public.protocol import latent_touch, slides, touch_calibration, touch_sets
from structlearn.tasks.public.protocol.avoidance_representations import REPRESENTATIONS
from structlearn.tasks.public.public_files import CALIBRATION, TABLES

FIT = FitParameters.model_construct(
    smoothing_hz=5.0, kernel_count=10, regression="joint", scaled_axes=(False,) * 3
)


SET_PARAMETERS = {
    **BOXES_PARAMETERS,
    "recorded_skin": SKIN_PARAMETERS,
    "recorded_ur10e": UR10E_PARAMETERS,
}


def rows(columns, values):
    return pd.DataFrame(values, columns=columns.split())


def spread(middle, count, width=0.01):
    """Numbers whose mean is `middle` and whose interval is narrow."""
    return middle + width * np.linspace(-1, 1, count)


def reach_tables(good):
    error = {"zvc": 0.03, "dtw": 0.04, "ls": 0.05}
    error |= {"wls_text": 0.02, "wls": 0.01} if good else {"wls_text": 0.06, "wls": 0.07}
    cuts = [
        (str(reach), "reach", method, error[method], -error[method], noise, seed)
        for noise in (0.0, 2.0)
        for seed in range(2)
        for method in METHODS
        for reach in range(1, 4)
    ]
    variants = dict.fromkeys(("learned from", "learned from, forcing not scaled"), 1.0)
    variants["left out"] = 0.5 if good else 90.0
    fits = [
        (mm, 2 * mm, 0.01 if good else 30.0, 0.1, str(reach), variant)
        for variant, mm in variants.items()
        for reach in range(1, 5)
    ]
    return {
        "cut_errors": rows("demonstration primitive method start_error_s end_error_s noise_mm seed", cuts),
        "reach_errors": rows("mean_mm max_mm end_mm nmse demonstration variant", fits),
    }


def coupling_tables(good):
    coupling, end = (17.0, 0.01) if good else (70.0, 0.5)
    distances = [
        (f"{reach:02}", 20, 60.0 + reach, coupling + 1.1 * reach, 17.0 + reach, end + 0.001 * reach, split)
        for split in range(2)
        for reach in range(4)
    ]
    fraction = np.linspace(0, 1, 40)
    profile = pd.DataFrame({"fraction": fraction, "phase": 1 - fraction})
    targets = [profile.assign(axis=axis, mean=1.0, std=0.5, learned=1.0) for axis in AXES]
    paths = [
        pd.DataFrame({"reach": "01", "path": path, "x": fraction, "y": 0.0, "z": 0.1})
        for path in ("recorded", "nominal", "coupling")
    ]
    scores = [(axis, 0.2, 0.01, 0.01, split) for split in range(2) for axis in AXES]
    ends = [(f"{reach:02}", 1.0, 1.0 + 200.0 * (reach == 4), reach < 4) for reach in range(5)]
    return {
        "coupling_completeness": rows("reach start_off_mm goal_off_mm complete", ends),
        "coupling_distances": rows(
            "reach learned_from nominal_mm coupling_mm spread_mm end_share split", distances
        ),
        "coupling_profile": profile.assign(nominal_mm=60.0, coupling_mm=17.0, spread_mm=17.0),
        "coupling_targets": pd.concat(targets),
        "coupling_paths": pd.concat(paths),
        "coupling_scores": rows("axis nmse target_end_share residual_end_share split", scores),
    }


def movement_tables(good):
    degrees = 0.3 if good else 9.0
    turns = [(log, log, 350.0, degrees, degrees, degrees) for log in ("01", "02", "03")]
    turns.append(("all", "their mean", 360.0, degrees, degrees, degrees))
    groups = dict.fromkeys(("m9_1", "m9_2", "m9_4"), "learned") | {"m9_3": "left out", "m9_12": "left out"}
    groups |= {f"m15_{trial}": "other material" for trial in range(1, 5)}
    level = {"learned": 5.0, "left out": 6.0, "other material": 20.0 if good else 2.0}
    deviations = [
        (name, group, level[group] + 0.1 * int(name.split("_")[1]), 40.0) for name, group in groups.items()
    ]
    time = np.arange(40) / 100
    statistics = [
        pd.DataFrame({"group": group, "electrode": electrode, "time_s": time, "mean": 1.0, "std": electrode})
        for group in level
        for electrode in range(1, 4)
    ]
    electrodes = [
        (part, electrode, 100.0 if electrode < 4 else 5.0, 1.0, error)
        for part in ("prim1", "prim2")
        for electrode, error in enumerate(spread(0.02 if good else 0.5, 8, 0.001))
    ]
    shown = [
        pd.DataFrame(
            {"primitive": part, "electrode": electrode, "time_s": time, "recorded": 1.0, "expected": 1.0}
        )
        for part in ("prim1", "prim2")
        for electrode in range(8)
    ]
    kinds = ("pose", "wrench")
    away = 60.0 if good else 1.0
    across = [
        (learned, name, name.split("_")[0], away + 0.1 * int(name.split("_")[1]), 2.0)
        for learned in ("m9", "m15")
        for name in groups
        if not name.startswith(learned)
    ]
    channels = [
        (name, name.split("_")[0], strength, 8, 5.0, (0.3 if good else 3.0) + 0.01 * len(name))
        for name in groups
        for strength in ("strong", "weak")
    ]
    return {
        "unscrewing_errors": rows("learned_from compared_with turn_deg mean_deg max_deg end_deg", turns),
        "sequence_errors": rows(
            "primitive mean_mm max_mm end_mm mean_deg max_deg end_deg",
            [(part, *[degrees] * 6) for part in ("prim1", "prim2", "prim3")],
        ),
        "electrode_scores": rows("primitive electrode range rms nmse", electrodes),
        "electrode_traces": pd.concat(shown),
        "clock_errors": rows(
            "kind samples median_gap_ms longest_gap_ms rms_error max_error",
            [(kind, 100, 6.6, 150.0, 1e-4, 3e-3) for kind in kinds],
        ),
        "slide_deviations": rows("demonstration group rms largest", deviations),
        "slide_left_one_out": rows(
            "demonstration material rms nmse",
            [
                (name, name.split("_")[0], 5.0 + rms, (0.3 if good else 3.0) + 0.01 * rms)
                for name, _, rms, _ in deviations
            ],
        ),
        "slide_channels": rows("demonstration material channels electrodes rms nmse", channels),
        "slide_across": rows("expected demonstration material rms nmse", across),
        "slide_statistics": pd.concat(statistics),
    }


def avoidance_tables(good):
    gain = 0.1 if good else -0.1
    ranks = {"human_inspired": 4, "network_validation": 3, "ridge": 3}
    ranks |= {"network": 2, "pmnn": 1, "ensemble": -4}

    def error(name, inputs):
        return (0.6 if good else 1.6) + gain * ranks[name] + (0 if inputs == "phase" else 0.5 * gain)

    folds = [
        (name, inputs, axis, fold, error(name, inputs) + noise)
        for name, inputs in REPRESENTATIONS
        for axis in AXES
        for fold, noise in enumerate(spread(0.0, 5, 0.002))
    ]
    folds = rows("representation inputs axis fold nmse", folds).assign(samples=20)
    keys = ["representation", "inputs", "axis"]
    scores = folds.groupby(keys, sort=False)["nmse"].mean().reset_index().assign(train=0.05)
    worth = scores[(scores["inputs"] != "features") & (scores["representation"] != "pmnn")][keys]
    return {
        "avoidance_folds": folds,
        "avoidance_scores": scores,
        "avoidance_phase": worth.assign(gain=gain, half_width=0.02),
    }


def touch_tables(good):
    error = 0.01 if good else 0.8
    reconstruction = dict.fromkeys(latent_touch.MODELS, error) | {latent_touch.COMPONENTS: 0.5}
    touched = [
        (*key, model, part, 0, reconstruction[model] + noise, 1.0, error + noise, 0.02)
        for key in public_names.TOUCH_ASKED
        for model in latent_touch.MODELS
        for part, noise in enumerate(spread(0.0, 4, 0.001))
    ]
    columns = "trials samples counts against start_counts end_counts components along_mm across_mm"
    sets = rows(
        f"set {columns}", [(name, 4, 900, 8.0, 0.2, 21.0, 3.0, 6, 0.2, 0.2) for name in latent_touch.PARTNERS]
    )
    pairs = [*((name, name, 0.4) for name in ("slides", "unscrewing"))]
    pairs += [(*pair, 0.4) for pair in latent_touch.PARTNERS.items()]
    electrodes = np.arange(1, 20)
    matrix = {"electrode": np.repeat(electrodes, 19), "other": np.tile(electrodes, 19), "correlation": 0.5}
    return {
        "touch_errors": rows(
            "learned_from asked_about new model part seed reconstruction worst_electrode distances pressure",
            touched,
        ),
        "touch_sets": sets.assign(along_std_mm=0.1, across_std_mm=0.1),
        "touch_likeness": rows("first second correlation", pairs),
        "touch_correlations": pd.concat(
            pd.DataFrame({"set": name, **matrix}) for name in latent_touch.PARTNERS
        ),
    }


def panda_tables(good):
    found = (0.02, 0.01, 0.008) if good else (5.0, 6.0, 7.0)
    level = dict(zip(("viscous", "coulomb", "offset"), found, strict=True))
    structures = ("nostr", "symm", "spd", "tri", "cov")
    models = [(URDF, "none", 4.0), ("mlp", "none", 0.1), ("mlp_scaled", "none", 0.07)]
    models += [("delan", "viscous", 0.3), ("delan", "coulomb", 0.3)]
    for friction, error in level.items():
        models += [(model, friction, error) for model in structures]
        models += [(LEAST_SQUARES, friction, error if good else 0.1 * error)]
    errors = [
        (model, friction, seed, part, joint, error + 1e-4 * seed)
        for model, friction, error in models
        for seed in range(3 if model in ("mlp", "mlp_scaled", "delan") else 1)
        for part in ("train", "test")
        for joint in range(1, 8)
    ]
    time = np.tile(np.arange(0, 4, 0.1), 7)
    traced = {f"{model}_{friction}".removesuffix("_none"): np.sin(time) for model, friction, _ in models}
    joints = {"joint": np.repeat(np.arange(1, 8), 40), "time_s": time, "measured": np.sin(time)}
    centre = dict.fromkeys((f"centre_{axis}_m" for axis in AXES), 0.1)
    links = {"model": "cov", "friction": "coulomb", "link": "link1", "mass_kg": 2.0, "true_mass_kg": 2.0}
    terms = [("cov", "coulomb", joint, term, 0.3) for joint in range(1, 8) for term in ("viscous", "coulomb")]
    torques = [(*keys, 5.0, 5.0, 1.2) for keys in product((1, -1), (False, True), (1, 2))]
    return {
        "panda_errors": rows("model friction seed part joint nmse", errors),
        "panda_friction": rows("model friction joint term value", terms),
        "panda_links": pd.DataFrame([links | centre]),
        "panda_traces": pd.DataFrame(joints | traced),
        "slide_torques": rows("sign payload joint measured_n_m model_n_m left_n_m", torques),
        "slide_payloads": pd.DataFrame({"sign": [1, -1], "mass_kg": [-11.8, 2.4], **centre}),
    }


@lru_cache
def made_up(good=True):
    """Results in which every claim holds, or none does."""
    movements = [_movement(place) for place in range(1, 5)]
    segments = segment_paths(movements, whole(movements), 5.0)
    turned = [replace(one, orientation=_turns(len(one.time))) for one in movements[:3]]
    turns = segment_paths(turned, whole(turned), 5.0)
    primitives = [learn_primitive(name, [segments[0]], FIT) for name in ("prim1", "prim2", "prim3")]
    path = sequence.unroll(primitives, movements[0].dt)
    parts = [replace(movements[0], name=one.name) for one in primitives]
    stored = reach_tables(good) | coupling_tables(good) | movement_tables(good) | avoidance_tables(good)
    stored |= touch_tables(good) | panda_tables(good)
    stored["sequence"] = sequence.sequence_table(path, [one.name for one in primitives])
    reach, turn = learn_primitive("reach", segments, FIT), learn_primitive("turn", turns, FIT)
    for name, its in (("boxes", past_boxes(good)), ("skin", on_skin(good)), ("ur10e", weighed(good))):
        stored |= {f"{name}_{table}": frame for table, frame in its.tables.items()}
    return RecordedResults(stored, segments, [reach], turns, [turn], parts, SET_PARAMETERS)


def _movement(place):
    """With a bump to one side or the other, so that movements are not their mean."""
    moved = two_move_demonstration(str(place), 1 + 0.1 * place)
    bump = 0.02 * (-1) ** place * np.sin(np.linspace(0, np.pi, len(moved.time)))
    return replace(moved, position=moved.position + np.outer(bump, [1.0, 0.0, 0.0]))


def _turns(samples):
    """Nearly a full turn about one axis, (samples, 4)."""
    half = np.linspace(0.0, 0.97 * np.pi, samples)
    return np.column_stack([np.cos(half), np.sin(half), np.zeros((samples, 2))])


def without(results, *parts):
    """The same results where there are no data of some parts."""
    missing = {table for part in parts for table in part.needs}
    tables = {name: table for name, table in results.tables.items() if name not in missing}
    nothing = {
        "reaches": {"reach_segments": (), "reach_primitives": ()},
        "unscrewing": {"unscrewing_segments": (), "unscrewing_primitives": ()},
        "scraping": {"execution": ()},
    }
    gone = {name: value for part in parts for name, value in nothing.get(part.name, {}).items()}
    return replace(results, tables=tables, **gone)


def report(results, reports=Path("no such folder")):
    return assembly.recorded_report(results, reports)


@lru_cache
def calibration(gain):
    """Tables of touch: recorded, and simulated `gain` times as strong."""
    *fingers, slid = traces(gain)
    fingers.append(replace(slid, group="slides, recorded"))
    table, electrodes, spectra, comparison = calibrated(fingers)
    found = [comparison, electrodes, table, spectra]
    found += [touch_calibration.component_table(fingers), touch_calibration.trace_table(fingers, PARAMETERS)]
    return dict(zip(CALIBRATION, found, strict=True))


def calibration_page(gain):
    stored = calibration(gain)
    return calibration_results.calibration_document(
        stored, calibration_results.tables(stored), {"calibrate": PARAMETERS}
    )


def test_made_up_tables_are_those_of_the_files():
    assert set(made_up().tables) == set(TABLES)


@pytest.mark.parametrize("part", assembly.PARTS, ids=lambda part: part.name)
@pytest.mark.parametrize(("good", "word"), [(True, "yes"), (False, "no")])
def test_every_claim_can_say_yes_and_no(part, good, word):
    found = verdicts(parts.__name__, part.evidence(made_up(good)), f"{part.name}_claims.yaml")
    held = {claim: word if verdict == BY_CONSTRUCTION else verdict for claim, verdict in found.items()}
    assert set(held.values()) == {word}


def test_pairs_are_reaches_and_not_draws():
    """Draws of rests hardly differ, and a reach that was left out more often counts no more."""
    found = reaches_part.evidence(made_up())
    assert {one.n for one in found["printed_over_crossing"].values()} == {3}
    gain = higher_reaches_part.evidence(made_up())["coupling_gain"]
    assert gain.n == 4
    uneven = made_up()["coupling_distances"].iloc[[0, *range(8)]]
    more = replace(made_up(), tables=made_up().tables | {"coupling_distances": uneven})
    assert higher_reaches_part.evidence(more)["coupling_gain"] == gain


def test_the_best_representation_is_one_for_all_axes():
    values = report(made_up()).metrics
    scores = made_up()["avoidance_scores"].set_index(["representation", "inputs", "axis"])["nmse"]
    for axis in AXES:
        assert values[f"obstacle_nmse_{axis}"] == scores["ensemble", "phase", axis]


@pytest.fixture(scope="module")
def published(tmp_path_factory):
    """Folder of the report, and the names of its figures."""
    made, folder = report(made_up()), tmp_path_factory.mktemp("recorded")
    drawn = assembly.recorded_pictures(made_up())
    publish_report(folder, made.pages, drawn, made.tables, made.metrics, made.headlines)
    return folder, list(drawn)


def test_the_pages_are_whole_and_short(published):
    folder, shown = published
    pages = {path.stem: path.read_text() for path in folder.glob("*.html")}
    assert set(pages) == {"index", *assembly.PAGES}
    assert words_in_view(pages["index"]) <= 1500
    assert all(words_in_view(page) <= 1500 for page in pages.values())
    assert all(any(f"figure-{name}" in page for page in pages.values()) for name in shown)
    assert not any('src="http' in page for page in pages.values())
    others = values_by_key(read_findings(folder / "findings.csv"))
    assert {"nominal_path_std_mm", "reach_fit_unscaled_end_max_mm", "touch_mds_nmse_slides"} <= set(others)
    for part in assembly.PARTS:
        assert f'id="{anchor(part.heading)}"' in pages["index"]
        assert f'id="{anchor(part.heading)}"' in pages[part.page]


@pytest.mark.parametrize("part", assembly.PARTS, ids=lambda part: part.name)
def test_a_set_that_is_not_recorded_is_said_to_be_missing_and_the_others_stay(part):
    whole, rest = report(made_up()), report(without(made_up(), part))
    gone = [one for one in assembly.PARTS if not one.there(without(made_up(), part))]
    assert part in gone  # with the reaches go those that are corrections of them
    words = {(one.heading, one.claim.evidence): one.verdict for one in rest.pages["index"].judged}
    missing = {(one.heading, claim.evidence) for one in gone for claim in one.claims}
    for one in whole.pages["index"].judged:
        key = one.heading, one.claim.evidence
        assert words[key] == ("not tested" if key in missing else one.verdict)
    assert {*whole.metrics} - {*rest.metrics} == {name for one in gone for name in one.metrics(made_up())}
    for name in ("index", part.page):
        text = render(rest.pages[name], AnyFigure())
        assert text.count("Not recorded here.") == len(gone)
        assert "not tested: not recorded here" in text or name != "index"


def test_nothing_at_all_makes_pages_too():
    made = report(without(made_up(), *assembly.PARTS))
    assert {one.verdict for one in made.pages["index"].judged} == {"not tested"}
    assert (made.metrics, made.tables, made.headlines) == ({}, {}, [])
    assert render(made.pages["index"], {}).count("Not recorded here.") == len(assembly.PARTS)


@pytest.mark.parametrize("missing", ["slides", "unscrewing"])
def test_touch_goes_on_with_one_of_its_sets(missing):
    gone = {missing, touch_part.PARTNERS[missing]}
    found = dict(made_up().tables)
    for name, columns in (
        ("touch_errors", ("learned_from", "asked_about")),
        ("touch_sets", ("set",)),
        ("touch_likeness", ("first", "second")),
        ("touch_correlations", ("set",)),
    ):
        for column in columns:
            found[name] = found[name][~found[name][column].isin(gone)]
    made = report(replace(made_up(), tables=found))
    left = next(name for name in touch_part.PARTNERS if name != missing)
    assert f"touch_reconstruction_nmse_{left}" in made.metrics
    assert f"touch_reconstruction_nmse_{missing}" not in made.metrics
    page = render(made.pages["touch"], AnyFigure())
    assert missing not in page.partition("<main>")[2].partition("<details")[0]
    assert all(touch_part.pictures(replace(made_up(), tables=found)).values())


def test_slides_over_one_material_are_enough():
    tables = dict(made_up().tables)
    for name in ("slide_deviations", "slide_left_one_out", "slide_channels"):
        its = tables[name]
        tables[name] = its[its["demonstration"].isin(["m9_1", "m9_2"])]
    tables["slide_across"] = tables["slide_across"][:0]
    tables["slide_statistics"] = tables["slide_statistics"].query("group == 'learned'")
    made = report(replace(made_up(), tables=tables))
    words = {one.claim.evidence: one.verdict for one in made.pages["index"].judged}
    assert words["other_material"] == "not tested"
    assert "slides_other_material_median_rms_counts" not in made.metrics
    for name in ("index", "movements"):
        render(made.pages[name], AnyFigure())
    slides_part.pictures(replace(made_up(), tables=tables))


def test_a_row_says_what_the_simulated_testbed_found(tmp_path):
    like = next(claim.simulated for claim in avoidance_part.PART.claims if claim.simulated)
    folder = tmp_path / like.testbed / "tables"
    folder.mkdir(parents=True)
    lines = ("by,statement,case,verdict", f'text,"{like.statement}",,no', "text,other,,yes")
    (folder / "claims.csv").write_text("\n".join(lines) + "\n")
    made = report(made_up(), tmp_path)
    (one,) = [one for one in made.pages["index"].judged if one.simulated]
    assert (one.claim.simulated, one.verdict, one.simulated) == (like, "yes", "no")
    page = render(made.pages["index"], AnyFigure())
    assert "Of 1 statements that were also tested in simulation, 0 have" in page
    assert f'title="{like.statement}"' in page
    table = claims_table(made.pages["index"].judged)
    assert list(table.loc[table["simulated"] != "", "statement"].unique()) == [one.claim.statement]
    assert list(dict.fromkeys(table["set"])) == [part.heading for part in assembly.PARTS]


def test_every_counterpart_is_a_statement_of_its_testbed(root):
    simulated = assembly.simulated_claims(root / "reports")
    likes = [claim.simulated for part in assembly.PARTS for claim in part.claims if claim.simulated]
    assert likes
    for like in likes:
        assert verdict_in(simulated[like.testbed], like), like.statement
        known = simulated[like.testbed].query("statement == @like.statement")["case"]
        assert set(like.cases) <= set(known)


def test_calibration_says_what_agrees(tmp_path):
    equal, stronger = calibration_page(1.0), calibration_page(3.0)
    assert {one.verdict for one in equal.judged} == {"yes"}
    found = {one.claim.evidence: one.verdict for one in stronger.judged}
    assert (found["contact"], found["noise"]) == ("no", "yes")
    assert equal.simulated
    drawn = calibration_figures.pictures(calibration(3.0), 0.99)
    page = render(stronger, dict.fromkeys(drawn, ()))
    assert words_in_view(page) <= 1500
    values = calibration_results.metrics(calibration(3.0)["comparison"])
    assert values["compared"] == len(calibration_results.STATISTICS)
    stronger = values["contact_strongest_simulated"] / values["contact_strongest_recorded"]
    assert stronger == pytest.approx(3, rel=0.05)


def test_calibration_without_a_recorded_execution_says_so():
    page = calibration_results.calibration_document({}, {}, {"calibrate": PARAMETERS})
    assert {one.verdict for one in page.judged} == {"not tested"}
    assert "No scraping execution is recorded here" in render(page, {})


def test_the_claims_bound_is_the_parameters_factor(root):
    parameters = touch_calibration.CalibrationParameters
    factor = read_parameters(root / "stages/recorded/params.yaml", "calibrate", parameters).factor
    claims = read_claims(package_files(assembly.PACKAGE) / "calibration_claims.yaml")
    assert {tuple(claim.bound) for claim in claims} == {(1 / factor, factor)}


def test_names_are_those_of_the_protocols():
    """They stand as text in `names`, so that drawing does not import what learns."""
    assert set(public_names.REPRESENTATIONS) == {name for name, _ in REPRESENTATIONS}
    assert set(public_names.INPUTS) == {inputs for _, inputs in REPRESENTATIONS}
    assert tuple(public_names.TOUCH_MODELS) == latent_touch.MODELS
    assert set(public_names.SLIDE_GROUPS) == set(slides.GROUPS)
    assert {name: touch_sets.PARTNERS[name] for name in touch_sets.RECORDED} == touch_part.PARTNERS
    assert {URDF, LEAST_SQUARES} < set(public_names.DYNAMICS_MODELS)
    known = {latent_touch.NEW_TRIALS, latent_touch.NEW_MATERIAL, latent_touch.OWN_UNITS, latent_touch.NEW_SET}
    assert {new for _, _, new in public_names.TOUCH_ASKED} == known
    assert {touch_calibration.REFERENCE, touch_calibration.SIMULATED} < set(public_names.TOUCH_WORLDS)
