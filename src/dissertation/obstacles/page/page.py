"""The page of the obstacle testbed: its tables, and names for its template and claims."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dissertation.evidence.claims import judge, read_claims
from dissertation.evidence.judged_page import JudgedDocument
from dissertation.evidence.studies import extended, rests_on
from dissertation.obstacles import files
from dissertation.obstacles.names import DEMONSTRATIONS, KINDS, RULES, SITUATIONS, SOURCES, fitted_name
from dissertation.obstacles.page.findings import (
    AS_PUBLISHED,
    EVERY,
    FEW_HITS,
    OURS,
    PEOPLE_STUDY,
    ObstacleResults,
    example_setting,
    read_published,
)
from dissertation.obstacles.protocol.avoidance_protocols import (
    LIMITED,
    MOVING,
    NO_MODEL,
    PAIR,
    PUBLISHED,
    TRAINED,
    UNSEEN,
)
from dissertation.obstacles.world.reaching_person import DETOURS_M
from dissertation.obstacles.world.scenarios import END_CLEARANCE_M
from structlearn.avoidance.learned_models import ALL, ENSEMBLE, HUMAN_INSPIRED, NETWORK, SETTING
from structlearn.avoidance.shapes import SHAPES
from structlearn.reporting.document import Source, Table
from structlearn.reporting.findings import Findings

PACKAGE = "dissertation.obstacles.page"
FOLDER = Path(__file__).parent

WRITTEN_BY = {
    "recorded": Source(files.RUNS, "obstacles_demonstrate"),
    "people": Source(files.PEOPLE_FILE, "obstacles_dataset"),
    "errors": Source(files.ERRORS_FILE, "obstacles_train"),
    "scores": Source(files.SCORES_FILE, "obstacles_evaluate"),
    "paths": Source(files.PATHS_FILE, "obstacles_evaluate"),
}


def document(results: ObstacleResults, find: Findings) -> JudgedDocument:
    """Page with its tables and verdicts; figures come from `figures.figures`."""
    published = read_published()
    shown = tables(results, published)
    limited = shown["limits"].frame
    named = facts(results, published) | find.numbers()
    named |= {
        "worst_goal": limited.loc[limited["goal_published"].idxmax()],
        "late_network": limited.loc[limited["model"].str.startswith(NETWORK), "late_goal_published"].max(),
    }
    return JudgedDocument(
        template="obstacles.html.jinja",
        package=PACKAGE,
        stage="obstacles_report",
        facts=named,
        tables=shown,
        judged=judge(read_claims(FOLDER / "claims.yaml"), find, named),
        sources=WRITTEN_BY,
        parameters=results.parameters,
        recordings="../rerun/obstacles",
        simulated=any(one.simulated for its in results.demonstrations.values() for one in its),
        basis=rests_on(PEOPLE_STUDY, results.study),
    )


def facts(results: ObstacleResults, published: Mapping[str, Any]) -> dict[str, Any]:
    """Names for the page's sentences besides the findings: parameters, counts and words."""
    spheres = results.situations[UNSEEN].obstacles[0]
    length = float(np.linalg.norm(results.baseline.goal - results.baseline.start))
    return {
        "published": published,
        "shapes": SHAPES,
        "few_hits": FEW_HITS,
        "shown": results.population.shown,
        "tuning": results.population.tuning,
        "setting": example_setting(results.scores, results.population.shown),
        "length": length,
        "longest_detour_m": DETOURS_M[-1],
        "end_clearance_m": END_CLEARANCE_M,
        **{key.removeprefix("obstacle_"): chosen for key, chosen in results.parameters.items()},
        "reaches": lambda protocol: results.reached(protocol)["reaches"].sum(),
        "unseen_spheres": len(results.situations[UNSEEN].numbers),
        "outside": int(((spheres.centre[:, 0] < 0.0) | (spheres.centre[:, 0] > length)).sum()),
        "radius_mm": 1e3 * float(spheres.radius[0]),
        "most_hits": lambda protocol: max(
            results.hits(protocol, kind, source) for kind in (NETWORK, ENSEMBLE) for source in EVERY
        ),
        "rai_hits": lambda protocol: max(results.hits(protocol, HUMAN_INSPIRED, shape) for shape in SHAPES),
    }


PRINTED, HERE = "dissertation", "here"

FITS = {"nmse": "all three axes", "nmse_across": "y and z", "nmse_dominant": "dominant axis"}
"""Columns of `ObstacleResults.fits`, and the axes they average."""

THREE_DIGITS = (
    *("nmse_train", "nmse_test", "nmse_x", "nmse_y", "nmse_z", "goal_max", "goal_mean", "late_goal_max"),
    *("obstacle_min", "obstacle_mean", "goal_published", "goal_limited", "late_goal_published"),
    *("late_goal_limited", "train_mean", "test_mean", "closest", "excursion"),
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
    **{"train_mean": "learned from, mean", "test_mean": "held out, mean"},
    **{"train_low": "learned from, low", "test_low": "held out, low", "excursion": "between"},
    **{"hits_published": "hits, published", "hits_limited": "limits", "goal_published": "goal, published"},
    **{"goal_limited": "limits", "late_goal_published": "late, published", "late_goal_limited": "limits"},
    **{"moving_0.1": "0.1 m/s", "moving_0.2": "0.2 m/s", "pair": "two", "goal_change": "moving goal"},
    **{"detour_unseen": "detour, unseen", "detour_moving": "moving", "detour_pair": "two"},
    **{"none": KINDS[NO_MODEL].name},
    **{f"{source}_published": f"{SOURCES[source].name}, published" for source in (*SHAPES, ALL)},
    **{f"{source}_ours": "ours" for source in (*SHAPES, ALL)},
}
COMPARED = (
    *("obstacle", "model", "source", "nmse_train", "nmse_test", "goal_max", "goal_mean"),
    *("late_goal_max", "obstacle_min", "obstacle_mean", "hits", "of"),
)
"""Columns, in order, of tables that compare with the dissertation's."""

Row = dict[str, Any]


def tables(results: ObstacleResults, published: Mapping[str, Any]) -> dict[str, Table]:
    """All tables, keyed by name; the study gathers `by_person` and `errors` of each cell."""
    own, errors = replace(results, study=None), extended(results.errors, results.study, "errors", "person")
    frames = {
        "people": people(results),
        "per_setting": per_setting(own, published["per_setting"]),
        "per_shape": per_shape(own, published["per_shape"]),
        "unseen": unseen(own, published["unseen"]),
        "fit": fit(results, published["largest_nmse"]),
        "limits": limits(results),
        "all_shapes": all_shapes(own),
        "hits": hits(own),
        "by_person": results.by_person,
        "errors": errors[errors["person"].isin(results.people)],
    }
    return {name: Table(frame, FORMATS, HEADINGS, _strong(frame)) for name, frame in frames.items()}


def people(results: ObstacleResults) -> pd.DataFrame:
    """Unseen spheres hit by person: without avoidance, with published networks, and with ensembles."""
    columns = {"person": results.people, "none": results.hits_by_person(UNSEEN, (NO_MODEL, LIMITED), "")[0]}
    for source in (*SHAPES, ALL):
        columns[f"{source}_published"] = results.hits_by_person(UNSEEN, AS_PUBLISHED, source)[0]
        columns[f"{source}_ours"] = results.hits_by_person(UNSEEN, OURS, source)[0]
    return pd.DataFrame(columns)


def per_setting(results: ObstacleResults, printed: Mapping[str, Row]) -> pd.DataFrame:
    """Table IV.1: models trained on one scenario."""
    rows: list[Row] = []
    for kind, source in ((NO_MODEL, ""), (HUMAN_INSPIRED, SETTING), (NETWORK, SETTING)):
        rows += _compared(results, {"model": KINDS[kind].name}, printed[kind], TRAINED, kind, source)
    name, its = DEMONSTRATIONS.name, results.demonstrated
    rows.append({"model": name, "source": PRINTED} | printed["demonstrations"])
    rows.append({"model": name, "source": HERE, "of": len(its)} | summary(its))
    return _in_order(rows)


def per_shape(results: ObstacleResults, printed: Mapping[str, Mapping[str, Row]]) -> pd.DataFrame:
    """Table IV.2: models trained on the settings of each shape; `nmse_train` and `nmse_test` over y and z."""
    rows: list[Row] = []
    for shape, kind in product(SHAPES, (NO_MODEL, NETWORK, ENSEMBLE)):
        labels: Row = {"obstacle": shape, "model": KINDS[kind].name}
        for part in ("train", "test") if kind != NO_MODEL else ():
            labels[f"nmse_{part}"] = results.fit(kind, shape, shape, part)["nmse_across"].mean()
        source = shape if kind != NO_MODEL else ""
        rows += _compared(results, labels, printed[shape].get(kind), TRAINED, kind, source, shape)
    return _in_order(rows)


def unseen(results: ObstacleResults, printed: Mapping[str, Row]) -> pd.DataFrame:
    """Table IV.3: models past unseen spheres, by training source."""
    rows: list[Row] = []
    models = [(NO_MODEL, ""), *((kind, shape) for shape in SHAPES for kind in (NETWORK, ENSEMBLE))]
    for kind, source in models:
        row = None if kind == ENSEMBLE else printed[source or NO_MODEL]
        rows += _compared(results, {"model": fitted_name(kind, source)}, row, UNSEEN, kind, source)
    return _in_order(rows)


def fit(results: ObstacleResults, low: float) -> pd.DataFrame:
    """Figure IV.10 as numbers: NMSE of models trained on one scenario, and how many have at most `low`."""
    rows = []
    for column, over in FITS.items():
        parts = {part: results.setting_fits(column, part) for part in ("train", "test")}
        for kind in (NETWORK, HUMAN_INSPIRED) if len(parts["test"]) else ():
            row: Row = {"over": over, "model": KINDS[kind].name, "scenarios": len(parts["test"])}
            row |= {f"{part}_mean": its[kind].mean() for part, its in parts.items()}
            rows.append(row | {f"{part}_low": int((its[kind] <= low).sum()) for part, its in parts.items()})
    return pd.DataFrame(rows)


def limits(results: ObstacleResults) -> pd.DataFrame:
    """Published rules against limits at the goal: hits, largest goal distances (m), restrained samples."""
    families = {"per setting": (SETTING,), "per shape": SHAPES, "all shapes": (ALL,)}
    rows = []
    for protocol, kind, words in product((TRAINED, UNSEEN), KINDS, families):
        found = {
            rules: results.reached(protocol, kind, families[words], rules) for rules in (PUBLISHED, LIMITED)
        }
        limited = found[LIMITED]
        count = int(limited["reaches"].sum())
        if count == 0:
            continue
        row: Row = {"obstacles": protocol, "model": f"{KINDS[kind].name}, {words}", "unrolls": count}
        row |= {f"hits_{name}": int(its["hits"].sum()) for name, its in found.items()}
        for column in ("goal", "late_goal"):
            row |= {f"{column}_{name}": its[f"{column}_distance_m"].max() for name, its in found.items()}
        row["excursion"] = limited["excursion_m"].max()
        rows.append(row | {"restrained": np.average(limited["restrained"], weights=limited["reaches"])})
    return pd.DataFrame(rows)


def all_shapes(results: ObstacleResults) -> pd.DataFrame:
    """Models of all shapes and models of one shape, on the settings of each obstacle."""
    rows = []
    for shape, kind, every in product(SHAPES, KINDS, (False, True)):
        source = ALL if every else shape
        scored = results.rows(TRAINED, kind, source, obstacle=shape)
        if len(scored):
            row = {"obstacle": shape, "model": fitted_name(kind, source)}
            row |= results.fit(kind, source, shape)[["nmse_x", "nmse_y", "nmse_z"]].mean().to_dict()
            rows.append(row | summary(scored))
    columns = ["obstacle", "model", "nmse_x", "nmse_y", "nmse_z", "hits", "obstacle_min", "goal_max"]
    return pd.DataFrame(rows)[columns]


def hits(results: ObstacleResults) -> pd.DataFrame:
    """Hits with limits at the goal by model and situation on the grid of spheres; mean detours in m."""
    rows = []
    for kind, source in results.contenders:
        row: Row = {"model": fitted_name(kind, source)}
        beyond = [protocol for protocol in SITUATIONS if protocol != TRAINED]
        every = {protocol: results.rows(protocol, kind, source) for protocol in beyond}
        for protocol, its in every.items():
            for speed, count in its.groupby("speed_m_s")["hit"].sum().items():
                row[f"{protocol}_{speed:g}" if protocol == MOVING else protocol] = int(count)
        row["closest"] = min(its["obstacle_distance"].min() for its in every.values())
        row |= {f"detour_{name}": every[name]["detour_m"].mean() for name in (UNSEEN, MOVING, PAIR)}
        rows.append(row)
    return pd.DataFrame(rows)


def summary(rows: pd.DataFrame) -> Row:
    """Extremes and means over scenarios of `avoidance_scores.unroll_scores` or `demonstration_scores`."""
    goal, obstacle = rows["goal_distance_m"], rows["obstacle_distance"]
    row: Row = {"goal_max": goal.max(), "goal_mean": goal.mean(), "hits": int(rows["hit"].sum())}
    row |= {"obstacle_min": obstacle.min(), "obstacle_mean": obstacle.mean()}
    late = rows.get("late_goal_distance_m")  # demonstrations have none
    return row if late is None else row | {"late_goal_max": late.max()}


def _compared(
    results: ObstacleResults,
    labels: Row,
    printed: Row | None,
    protocol: str,
    kind: str,
    source: str,
    obstacle: str | None = None,
) -> list[Row]:
    """Rows of a model as printed, if it is, and here with both rules (one row if there is no model)."""
    rules = {LIMITED: HERE} if kind == NO_MODEL else {its: f"{HERE}, {words}" for its, words in RULES.items()}
    places = [one for one in results.scenarios if obstacle in (None, one.shape)]
    count = len(results.situations[UNSEEN].numbers) if protocol == UNSEEN else len(places)
    rows = [labels | {"source": PRINTED, "of": count} | printed] if printed else []
    for its, words in rules.items():
        scored = results.rows(protocol, kind, source, its, obstacle)
        rows.append(labels | {"source": words} | summary(scored) | {"of": len(scored)})
    return rows


def _in_order(rows: Sequence[Row]) -> pd.DataFrame:
    frame = pd.DataFrame(rows)
    return frame[[name for name in COMPARED if name in frame]]


def _strong(frame: pd.DataFrame) -> frozenset[int]:
    """Indices of rows with the published rules, which compare with printed rows."""
    sources = frame.get("source", pd.Series(dtype=str))
    return frozenset(row for row, words in enumerate(sources) if words == f"{HERE}, {RULES[PUBLISHED]}")
