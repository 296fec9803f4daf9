"""The page of the obstacle testbed: its tables, and names for its template and claims."""

from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dissertation.evidence.claims import judge, read_claims
from dissertation.evidence.judged_page import JudgedDocument
from dissertation.evidence.results import Population, Results
from dissertation.evidence.studies import Study, rests_on
from dissertation.obstacles import files
from dissertation.obstacles.names import DEMONSTRATIONS, KINDS, RULES, SITUATIONS, SOURCES, model_name
from dissertation.obstacles.page.findings import (
    AS_PUBLISHED,
    BARE,
    EVERY,
    FEW_HITS,
    OURS,
    counts,
    of_settings,
    read_published,
)
from dissertation.obstacles.page.shown import Shown
from dissertation.obstacles.protocol.avoidance_protocols import (
    LIMITED,
    NO_MODEL,
    PUBLISHED,
    TRAINED,
    UNSEEN,
)
from dissertation.obstacles.protocol.results import DEMONSTRATED
from dissertation.obstacles.world.reaching_person import DETOURS_M
from dissertation.obstacles.world.scenarios import END_CLEARANCE_M
from structlearn.avoidance.learned_models import ALL, ENSEMBLE, HUMAN_INSPIRED, NETWORK, SETTING
from structlearn.avoidance.shapes import SHAPES
from structlearn.core.params import read_values
from structlearn.reporting.document import Source, Table
from structlearn.reporting.evidence import geometric_mean
from structlearn.reporting.findings import Findings

PACKAGE = "dissertation.obstacles.page"
FOLDER = Path(__file__).parent
PEOPLE_STUDY = "obstacles/people"  # further people, pooled in the verdicts

WRITTEN_BY = {
    "recorded": Source(files.RUNS, "obstacles_demonstrate"),
    "people": Source(files.PEOPLE_FILE, "obstacles_dataset"),
    "scores": Source(files.SCORES_FILE, "obstacles_evaluate"),
    "paths": Source(files.PATHS_FILE, "obstacles_evaluate"),
    "results": Source("data/results/obstacles.parquet", "obstacles_results"),
}


def document(population: Population, shown: Shown, find: Findings, study: Study | None) -> JudgedDocument:
    """Page with its tables and verdicts; figures come from `figures.figures`."""
    published = read_published()
    made = tables(population, shown, published)
    named = facts(population, shown, published) | find.numbers()
    return JudgedDocument(
        template="obstacles.html.jinja",
        package=PACKAGE,
        stage="obstacles_report",
        facts=named,
        tables=made,
        judged=judge(read_claims(FOLDER / "claims.yaml"), find, named),
        sources=WRITTEN_BY,
        parameters=shown.parameters,
        recordings="../rerun/obstacles",
        simulated=any(one.simulated for its in shown.demonstrations.values() for one in its),
        basis=rests_on(PEOPLE_STUDY, study),
    )


def facts(population: Population, shown: Shown, published: Mapping[str, Any]) -> dict[str, Any]:
    """Names for the page's sentences besides the findings: parameters, counts and words."""
    spheres = shown.situations[UNSEEN].obstacles[0]
    length = float(np.linalg.norm(shown.baseline.goal - shown.baseline.start))
    tests = shown.population.test
    return {
        "published": published,
        "not_tested": read_values(FOLDER / "not_tested.yaml"),
        "moved": population.moved,
        "people_of_this_run": len(tests),
        "shapes": SHAPES,
        "few_hits": FEW_HITS,
        "shown": shown.population.shown,
        "tuning": shown.population.tuning,
        "setting": shown.setting,
        "scenarios": len(shown.scenarios),
        "demonstrations": int(shown.demonstrated["person"].isin(tests).sum()),
        "length": length,
        "longest_detour_m": DETOURS_M[-1],
        "end_clearance_m": END_CLEARANCE_M,
        **{key.removeprefix("obstacle_"): chosen for key, chosen in shown.parameters.items()},
        "unseen_spheres": len(shown.situations[UNSEEN].numbers),
        "outside": int(((spheres.centre[:, 0] < 0.0) | (spheres.centre[:, 0] > length)).sum()),
        "radius_mm": 1e3 * float(spheres.radius[0]),
    }


PRINTED, HERE = "dissertation", "here"

FITS = {"all": "all three axes", "across": "y and z", "dominant": "dominant axis"}
"""Axes of errors of models trained on one scenario."""

THREE_DIGITS = (
    *("nmse_train", "nmse_test", "nmse_x", "nmse_y", "nmse_z", "goal_max", "goal_mean", "late_goal_max"),
    *("obstacle_min", "obstacle_mean", "goal_published", "goal_limited", "late_goal_published"),
    *("late_goal_limited", "train_median", "test_median", "excursion"),
)
FORMATS = {
    **dict.fromkeys(THREE_DIGITS, ".3f"),
    **dict.fromkeys(("detour_unseen", "detour_moving", "detour_pair"), ".2f"),
    "restrained": ".1%",
}
HEADINGS = {
    **{"source": "", "nmse_train": "NMSE train", "nmse_test": "test", "goal_mean": "mean"},
    **{"goal_max": "goal max", "late_goal_max": "late max", "obstacle_min": "obstacle min"},
    **{"obstacle_mean": "mean", "nmse_x": "x", "nmse_y": "y", "nmse_z": "z", "over": "NMSE over"},
    **{"train_median": "learned from, median", "test_median": "held out, median"},
    **{"train_low": "learned from, low", "test_low": "held out, low", "excursion": "between"},
    **{"hits_published": "hits, published", "hits_limited": "limits", "goal_published": "goal, published"},
    **{"goal_limited": "limits", "late_goal_published": "late, published", "late_goal_limited": "limits"},
    **{"pair": "two", "goal_change": "moving goal"},
    **{"detour_unseen": "detour, unseen", "detour_moving": "moving", "detour_pair": "two"},
    **{"none": KINDS[NO_MODEL].name},
    **{f"{source}_published": f"{SOURCES[source].name}, published" for source in EVERY},
    **{f"{source}_ours": "ours" for source in EVERY},
}
COMPARED = (
    *("obstacle", "model", "source", "nmse_train", "nmse_test", "goal_max", "goal_mean"),
    *("late_goal_max", "obstacle_min", "obstacle_mean", "hits", "of"),
)
"""Columns, in order, of tables that compare with the dissertation's."""

Row = dict[str, Any]


def tables(population: Population, shown: Shown, published: Mapping[str, Any]) -> dict[str, Table]:
    """All tables, keyed by name."""
    every = population.results
    one = population.one.table
    own = Results(one[one["person"].isin(shown.population.test)], "person")
    frames = {
        "people": people(every),
        "per_setting": per_setting(own, published["per_setting"]),
        "per_shape": per_shape(own, published["per_shape"]),
        "unseen": unseen(own, published["unseen"]),
        "fit": fit(every, published["largest_nmse"]),
        "limits": limits(every),
        "all_shapes": all_shapes(own),
        "hits": hits(every),
    }
    return {name: Table(frame, FORMATS, HEADINGS, _strong(frame)) for name, frame in frames.items()}


def people(results: Results) -> pd.DataFrame:
    """Unseen spheres hit by person: without avoidance, with published networks, and with ensembles."""
    columns = {"none": counts(results, UNSEEN, BARE, "")[0]}
    for source in EVERY:
        columns[f"{source}_published"] = counts(results, UNSEEN, AS_PUBLISHED, source)[0]
        columns[f"{source}_ours"] = counts(results, UNSEEN, OURS, source)[0]
    return pd.DataFrame(columns).astype("Int64").rename_axis("person").reset_index()


def per_setting(results: Results, printed: Mapping[str, Row]) -> pd.DataFrame:
    """Table IV.1: models trained on one scenario."""
    rows: list[Row] = []
    for kind, source in ((NO_MODEL, ""), (HUMAN_INSPIRED, SETTING), (NETWORK, SETTING)):
        its = {"protocol": TRAINED, "model": kind, "learned_from": source}
        rows += _compared(results, {"model": KINDS[kind].name}, printed[kind] | {"of": 120}, **its)
    name = DEMONSTRATIONS.name
    rows.append({"model": name, "source": PRINTED} | printed[DEMONSTRATED])
    rows.append({"model": name, "source": HERE} | summary(results, model=DEMONSTRATED, learned_from=""))
    return _in_order(rows)


def per_shape(results: Results, printed: Mapping[str, Mapping[str, Row]]) -> pd.DataFrame:
    """Table IV.2: models trained on the settings of each shape; `nmse_train` and `nmse_test` over y and z."""
    rows: list[Row] = []
    for shape, kind in product(SHAPES, (NO_MODEL, NETWORK, ENSEMBLE)):
        labels: Row = {"obstacle": shape, "model": KINDS[kind].name}
        for part in ("train", "test") if kind != NO_MODEL else ():
            labels[f"nmse_{part}"] = nmse(results, kind, shape, shape, "across", part)
        row = printed[shape].get(kind)
        its = {"protocol": TRAINED, "model": kind, "learned_from": "" if kind == NO_MODEL else shape}
        rows += _compared(results, labels, row and row | {"of": 40}, obstacle=shape, **its)
    return _in_order(rows)


def unseen(results: Results, printed: Mapping[str, Row]) -> pd.DataFrame:
    """Table IV.3: models past unseen spheres, by training source."""
    rows: list[Row] = []
    models = [(NO_MODEL, ""), *((kind, shape) for shape in SHAPES for kind in (NETWORK, ENSEMBLE))]
    for kind, source in models:
        row = None if kind == ENSEMBLE else printed[source or NO_MODEL] | {"of": 63}
        its = {"protocol": UNSEEN, "model": kind, "learned_from": source}
        rows += _compared(results, {"model": model_name(kind, source)}, row, **its)
    return _in_order(rows)


def fit(results: Results, low: float) -> pd.DataFrame:
    """Figure IV.10 as numbers: NMSE of models trained on one scenario, and how many have at most `low`."""
    rows = []
    for axis, over in FITS.items():
        parts = {part: of_settings(results, axis, part) for part in ("train", "test")}
        for kind in (NETWORK, HUMAN_INSPIRED) if len(parts["test"]) else ():
            row: Row = {"over": over, "model": KINDS[kind].name, "scenarios": len(parts["test"])}
            row |= {f"{part}_median": its[kind].median() for part, its in parts.items()}
            rows.append(row | {f"{part}_low": int((its[kind] <= low).sum()) for part, its in parts.items()})
    return pd.DataFrame(rows)


def limits(results: Results) -> pd.DataFrame:
    """Published rules against limits at the goal: hits, largest goal distances (m), restrained samples."""
    families = {"per setting": [SETTING], "per shape": list(SHAPES), "all shapes": [ALL]}
    rows = []
    for protocol, kind, words in product((TRAINED, UNSEEN), KINDS, families):
        its = {"protocol": protocol, "model": kind, "learned_from": families[words]}
        found = {rules: summary(results, rules=rules, **its) for rules in (PUBLISHED, LIMITED)}
        limited = found[LIMITED]
        if not limited:
            continue
        row: Row = {"obstacles": protocol, "model": f"{KINDS[kind].name}, {words}", "unrolls": limited["of"]}
        row |= {f"hits_{name}": one["hits"] for name, one in found.items()}
        for column in ("goal", "late_goal"):
            row |= {f"{column}_{name}": one[f"{column}_max"] for name, one in found.items()}
        rows.append(row | {name: limited[name] for name in ("excursion", "restrained")})
    return pd.DataFrame(rows)


def all_shapes(results: Results) -> pd.DataFrame:
    """Models of all shapes and models of one shape, on the settings of each obstacle."""
    rows = []
    for shape, kind, every in product(SHAPES, KINDS, (False, True)):
        source = ALL if every else shape
        its = {"protocol": TRAINED, "model": kind, "learned_from": source, "obstacle": shape}
        if scored := summary(results, rules=LIMITED, **its):
            row: Row = {"obstacle": shape, "model": model_name(kind, source)}
            row |= {f"nmse_{axis}": nmse(results, kind, source, shape, axis) for axis in "xyz"}
            rows.append(row | scored)
    columns = ["obstacle", "model", "nmse_x", "nmse_y", "nmse_z", "hits", "obstacle_min", "goal_max"]
    return pd.DataFrame(rows)[columns]


def hits(results: Results) -> pd.DataFrame:
    """Hits with limits at the goal by model and situation on the grid of spheres; mean detours in m."""
    rows = []
    beyond = [protocol for protocol in SITUATIONS if protocol != TRAINED]
    for kind, source in product(KINDS, ("", *EVERY)):
        its = {"model": kind, "learned_from": source, "rules": LIMITED}
        if every := {one: found for one in beyond if (found := summary(results, protocol=one, **its))}:
            row: Row = {"model": model_name(kind, source)} | {one: its["hits"] for one, its in every.items()}
            rows.append(row | {f"detour_{one}": its["detour"] for one, its in every.items()})
    return pd.DataFrame(rows).drop(columns="detour_goal_change")


def nmse(results: Results, kind: str, source: str, shape: str, axis: str, part: str = "test") -> float:
    """Geometric mean over people of the NMSE of a model, on the settings of a shape."""
    keys = {"model": kind, "learned_from": source, "obstacle": shape, "axis": axis, "part": part}
    return geometric_mean(results.each("nmse", **keys).to_numpy()).value


def summary(results: Results, **keys: object) -> Row:
    """Sums, extremes and means over all reaches with these keys; empty if there are none."""
    by = ["person", "protocol", "rules", "learned_from", "obstacle"]
    names = {"goal_max": "largest_goal_distance", "late_goal_max": "largest_late_goal_distance"}
    names |= {"obstacle_min": "closest", "goal_mean": "mean_goal_distance", "obstacle_mean": "mean_distance"}
    names |= {"excursion": "largest_excursion", "detour": "mean_detour", "restrained": "restrained"}
    of = results.rows("reaches", **keys).set_index(by)["value"]
    if of.empty:
        return {}
    row: Row = {"hits": int(results.rows("hits", **keys)["value"].sum()), "of": int(of.sum())}
    for name, quantity in names.items():
        values = results.rows(quantity, **keys).set_index(by)["value"]
        if name.endswith("_max") or name == "excursion":
            row[name] = values.max()
        elif name.endswith("_min"):
            row[name] = values.min()
        elif len(values):
            row[name] = np.average(values, weights=of.loc[values.index])
    return row


def _compared(results: Results, labels: Row, printed: Row | None, **keys: object) -> list[Row]:
    """Rows of a model as printed, if it is, and here with both rules (one row if there is no model)."""
    rules = {its: f"{HERE}, {words}" for its, words in RULES.items()}
    rules = {LIMITED: HERE} if keys["model"] == NO_MODEL else rules
    rows = [labels | {"source": PRINTED} | printed] if printed else []
    for its, words in rules.items():
        rows.append(labels | {"source": words} | summary(results, rules=its, **keys))
    return rows


def _in_order(rows: Sequence[Row]) -> pd.DataFrame:
    frame = pd.DataFrame(rows)
    return frame[[name for name in COMPARED if name in frame]]


def _strong(frame: pd.DataFrame) -> frozenset[int]:
    """Indices of rows with the published rules, which compare with printed rows."""
    sources = frame.get("source", pd.Series(dtype=str))
    return frozenset(row for row, words in enumerate(sources) if words == f"{HERE}, {RULES[PUBLISHED]}")
