"""The pages of recorded data: every claim can say yes and no, and what is shown is there."""

from dataclasses import replace
from functools import lru_cache
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from reporting_verdicts import AnyFigure, verdicts
from test_recorded_boxes_page import PARAMETERS as BOXES_PARAMETERS
from test_recorded_boxes_page import made_up as past_boxes
from test_recorded_ur10e import PARAMETERS as UR10E_PARAMETERS
from test_recorded_ur10e import made_up as weighed

from structlearn.primitives.fitting import FitParameters
from structlearn.reporting.claims import BY_CONSTRUCTION, claims_table, verdict_in
from structlearn.reporting.document import anchor, render, words_in_view
from structlearn.reporting.findings import read_findings, values_by_key
from structlearn.reporting.publishing import publish_report
from structlearn.rigid_body.arm_identification import LEAST_SQUARES, URDF
from structlearn.tasks.public import public_names
from structlearn.tasks.public.page import assembly, parts
from structlearn.tasks.public.page.parts import avoidance_part
from structlearn.tasks.public.page.recorded_results import AXES, RecordedResults
from structlearn.tasks.public.protocol.avoidance_representations import REPRESENTATIONS
from structlearn.tasks.public.public_files import TABLES

FIT = FitParameters.model_construct(
    smoothing_hz=5.0, kernel_count=10, regression="joint", scaled_axes=(False,) * 3
)


SET_PARAMETERS = {
    **BOXES_PARAMETERS,
    "recorded_ur10e": UR10E_PARAMETERS,
}


def rows(columns, values):
    return pd.DataFrame(values, columns=columns.split())


def spread(middle, count, width=0.01):
    """Numbers whose mean is `middle` and whose interval is narrow."""
    return middle + width * np.linspace(-1, 1, count)


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
    stored = avoidance_tables(good) | panda_tables(good)
    for name, its in (("boxes", past_boxes(good)), ("ur10e", weighed(good))):
        stored |= {f"{name}_{table}": frame for table, frame in its.tables.items()}
    return RecordedResults(stored, SET_PARAMETERS)


def without(results, *parts):
    """The same results where there are no data of some parts."""
    missing = {table for part in parts for table in part.needs}
    tables = {name: table for name, table in results.tables.items() if name not in missing}
    return replace(results, tables=tables)


def report(results, reports=Path("no such folder")):
    return assembly.recorded_report(results, reports)


def test_made_up_tables_are_those_of_the_files():
    assert set(made_up().tables) == set(TABLES)


@pytest.mark.parametrize("part", assembly.PARTS, ids=lambda part: part.name)
@pytest.mark.parametrize(("good", "word"), [(True, "yes"), (False, "no")])
def test_every_claim_can_say_yes_and_no(part, good, word):
    found = verdicts(parts.__name__, part.evidence(made_up(good)), f"{part.name}_claims.yaml")
    held = {claim: word if verdict == BY_CONSTRUCTION else verdict for claim, verdict in found.items()}
    assert set(held.values()) == {word}


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
    assert "boxes_path_mm" in others
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


def test_names_are_those_of_the_protocols():
    """They stand as text in `names`, so that drawing does not import what learns."""
    assert set(public_names.REPRESENTATIONS) == {name for name, _ in REPRESENTATIONS}
    assert set(public_names.INPUTS) == {inputs for _, inputs in REPRESENTATIONS}
    assert {URDF, LEAST_SQUARES} < set(public_names.DYNAMICS_MODELS)
