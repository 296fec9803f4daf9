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
from dissertation.obstacles.names import DEMONSTRATIONS, KINDS, RULES, SITUATIONS, fitted_name
from dissertation.obstacles.page.findings import (
    EVERY,
    FEW_HITS,
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
from dissertation.obstacles.world.scenarios import END_CLEARANCE_M
from dissertation.simulation.individuals import differences
from structlearn.avoidance.learned_models import ENSEMBLE, HUMAN_INSPIRED, NETWORK, SETTING
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
        "untested": read_values(FOLDER / "untested.yaml"),
        "moved": population.moved,
        "people_of_this_run": len(tests),
        "recorded_clearance": shown.recorded_people.loc[("clearance_m", "shared")],
        "recorded_pace": shown.recorded_people.loc[("movement_s", "shared")],
        "shapes": SHAPES,
        "few_hits": FEW_HITS,
        "shown": shown.population.shown,
        "tuning": shown.population.tuning,
        "setting": shown.setting,
        "scenarios": len(shown.scenarios),
        "demonstrations": int(shown.demonstrated["person"].isin(tests).sum()),
        "length": length,
        "end_clearance_m": END_CLEARANCE_M,
        **{key.removeprefix("obstacle_"): chosen for key, chosen in shown.parameters.items()},
        "unseen_spheres": len(shown.situations[UNSEEN].numbers),
        "outside": int(((spheres.centre[:, 0] < 0.0) | (spheres.centre[:, 0] > length)).sum()),
        "radius_mm": 1e3 * float(spheres.radius[0]),
    }


PRINTED, HERE = "dissertation", "here"

DISTANCES, DETOURS = (
    ("nmse_train", "nmse_test", "goal_max", "goal_mean", "late_goal_max", "obstacle_min", "obstacle_mean"),
    ("detour_unseen", "detour_moving", "detour_pair"),
)
FORMATS = dict.fromkeys(DISTANCES, ".3f") | dict.fromkeys(DETOURS, ".2f")
HEADINGS = {
    **{"source": "", "nmse_train": "NMSE train", "nmse_test": "test", "goal_mean": "mean"},
    **{"goal_max": "goal max", "late_goal_max": "late max", "obstacle_min": "obstacle min"},
    **{"obstacle_mean": "mean", "pair": "two", "goal_change": "moving goal"},
    **{"detour_unseen": "detour, unseen", "detour_moving": "moving", "detour_pair": "two"},
}
COMPARED = (
    *("obstacle", "model", "source", "nmse_train", "nmse_test", "goal_max", "goal_mean"),
    *("late_goal_max", "obstacle_min", "obstacle_mean", "hits", "of"),
)
"""Columns, in order, of tables that compare with the dissertation's."""

REDUCED = {
    "goal_max": ("largest_goal_distance", "max"),
    "goal_mean": ("mean_goal_distance", "mean"),
    "late_goal_max": ("largest_late_goal_distance", "max"),
    "obstacle_min": ("closest", "min"),
    "obstacle_mean": ("mean_distance", "mean"),
    "detour": ("mean_detour", "mean"),
}
"""Quantity, and how it is reduced over people and obstacles, by column; means are over reaches."""

Row = dict[str, Any]


def tables(population: Population, shown: Shown, published: Mapping[str, Any]) -> dict[str, Table]:
    """All tables, keyed by name."""
    every = population.results
    one = population.one.table
    own = Results(one[one["person"].isin(shown.population.test)], "person")
    frames = {
        "per_setting": per_setting(own, published["per_setting"]),
        "per_shape": per_shape(own, published["per_shape"]),
        "unseen": unseen(own, published["unseen"]),
        "hits": hits(every),
        "differences": differences(shown.parameters["obstacle_demonstrator"]),
    }
    return {name: Table(frame, FORMATS, HEADINGS, _strong(frame)) for name, frame in frames.items()}


def per_setting(results: Results, printed: Mapping[str, Row]) -> pd.DataFrame:
    """Table IV.1: models trained on one scenario."""
    rows: list[Row] = []
    for kind, source in ((NO_MODEL, ""), (HUMAN_INSPIRED, SETTING), (NETWORK, SETTING)):
        its = {"protocol": TRAINED, "model": kind, "learned_from": source}
        rows += _compared(results, {"model": KINDS[kind].name}, printed[kind], **its)
    labels = {"model": DEMONSTRATIONS.name}
    its = {"model": DEMONSTRATED, "learned_from": ""}
    return _in_order(rows + _compared(results, labels, printed[DEMONSTRATED], **its), 120)


def per_shape(results: Results, printed: Mapping[str, Mapping[str, Row]]) -> pd.DataFrame:
    """Table IV.2: models trained on the settings of each shape; `nmse_train` and `nmse_test` over y and z."""
    rows: list[Row] = []
    for shape, kind in product(SHAPES, (NO_MODEL, NETWORK, ENSEMBLE)):
        source = "" if kind == NO_MODEL else shape
        its = {"model": kind, "learned_from": source, "obstacle": shape}
        labels: Row = {"obstacle": shape, "model": KINDS[kind].name}
        for part in ("train", "test") if source else ():
            errors = results.each("nmse", axis="across", part=part, **its)
            labels[f"nmse_{part}"] = geometric_mean(errors.to_numpy()).value
        rows += _compared(results, labels, printed[shape].get(kind), protocol=TRAINED, **its)
    return _in_order(rows, 40)


def unseen(results: Results, printed: Mapping[str, Row]) -> pd.DataFrame:
    """Table IV.3: models past unseen spheres, by training source."""
    rows: list[Row] = []
    for source, kind in (("", NO_MODEL), *product(SHAPES, (NETWORK, ENSEMBLE))):
        row = None if kind == ENSEMBLE else printed[source or NO_MODEL]
        its = {"protocol": UNSEEN, "model": kind, "learned_from": source}
        rows += _compared(results, {"model": fitted_name(kind, source)}, row, **its)
    return _in_order(rows, 63)


def hits(results: Results) -> pd.DataFrame:
    """Hits with limits at the goal by model and situation on the grid of spheres; mean detours in m."""
    rows = []
    beyond = [protocol for protocol in SITUATIONS if protocol != TRAINED]
    for kind, source in product(KINDS, ("", *EVERY)):
        its = {"model": kind, "learned_from": source, "rules": LIMITED}
        if every := {one: found for one in beyond if (found := summary(results, protocol=one, **its))}:
            row: Row = {"model": fitted_name(kind, source)} | {one: its["hits"] for one, its in every.items()}
            rows.append(row | {f"detour_{one}": its["detour"] for one, its in every.items()})
    return pd.DataFrame(rows).drop(columns="detour_goal_change")


def summary(results: Results, **keys: object) -> Row:
    """Sums, extremes and means over all reaches with these keys; empty if there are none."""
    by = ["person", "protocol", "rules", "learned_from", "obstacle"]
    of = results.rows("reaches", **keys).set_index(by)["value"]
    if of.empty:
        return {}
    row: Row = {"hits": int(results.rows("hits", **keys)["value"].sum()), "of": int(of.sum())}
    for name, (quantity, how) in REDUCED.items():
        values = results.rows(quantity, **keys).set_index(by)["value"]
        weighted = (values * of).sum() / of.loc[values.index].sum() if how == "mean" and len(values) else None
        row[name] = weighted if how == "mean" else values.agg(how)
    return row


def _compared(results: Results, labels: Row, printed: Row | None, **keys: object) -> list[Row]:
    """Rows of a model as printed, if it is, and here with both rules, or in one row without any."""
    rules = {its: f"{HERE}, {words}" for its, words in RULES.items()}
    rules = {NO_MODEL: {LIMITED: HERE}, DEMONSTRATED: {"": HERE}}.get(str(keys["model"]), rules)
    rows = [labels | {"source": PRINTED} | printed] if printed else []
    for its, words in rules.items():
        rows.append(labels | {"source": words} | summary(results, rules=its, **keys))
    return rows


def _in_order(rows: Sequence[Row], printed: int) -> pd.DataFrame:
    """Table of rows; `printed`: number of reaches of printed rows."""
    frame = pd.DataFrame(rows)[lambda its: [name for name in COMPARED if name in its]]
    return frame.fillna({"of": printed}).astype({"of": int})


def _strong(frame: pd.DataFrame) -> frozenset[int]:
    """Indices of rows with the published rules, which compare with printed rows."""
    sources = frame.get("source", pd.Series(dtype=str))
    return frozenset(row for row, words in enumerate(sources) if words == f"{HERE}, {RULES[PUBLISHED]}")
