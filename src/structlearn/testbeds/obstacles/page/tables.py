"""Tables of the obstacle testbed: published beside reproduced, and models beside models."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from structlearn.avoidance.learned_models import ALL, HUMAN_INSPIRED, NETWORK, SETTING
from structlearn.avoidance.shapes import SHAPES
from structlearn.reporting.document import Table
from structlearn.testbeds.obstacles.names import DEMONSTRATIONS, KINDS, RULES, SITUATIONS, model_name
from structlearn.testbeds.obstacles.page.results import ObstacleResults
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import (
    LIMITED,
    MOVING,
    NO_MODEL,
    PAIR,
    PUBLISHED,
    TRAINED,
    UNSEEN,
)
from structlearn.testbeds.obstacles.protocol.avoidance_scores import summary

PRINTED, HERE = "dissertation", "here"

FITS = {"nmse": "all three axes", "nmse_across": "y and z", "nmse_dominant": "dominant axis"}
"""Columns of `ObstacleResults.fits` and over what they are averaged."""

FORMATS = {
    **dict.fromkeys(("nmse_train", "nmse_test", "nmse_x", "nmse_y", "nmse_z"), ".3f"),
    **dict.fromkeys(("goal_max", "goal_mean", "late_goal_max", "obstacle_min", "obstacle_mean"), ".3f"),
    **{f"{name}_{rules}": ".3f" for name in ("goal", "late_goal") for rules in ("text", "limited")},
    **dict.fromkeys(("train_mean", "test_mean", "closest", "excursion"), ".3f"),
    **dict.fromkeys(("detour_unseen", "detour_moving", "detour_pair"), ".2f"),
    "restrained": ".1%",
}
HEADINGS = {
    **{"source": "", "nmse_train": "NMSE train", "nmse_test": "test", "goal_mean": "mean"},
    **{"goal_max": "goal max", "late_goal_max": "late max", "obstacle_min": "obstacle min"},
    **{"obstacle_mean": "mean", "nmse_x": "x", "nmse_y": "y", "nmse_z": "z", "over": "NMSE over"},
    **{"train_mean": "learned from, mean", "test_mean": "held out, mean"},
    **{"train_low": "learned from, low", "test_low": "held out, low", "excursion": "between"},
    **{"hits_text": "hits, text", "hits_limited": "limits", "goal_text": "goal, text"},
    **{"goal_limited": "limits", "late_goal_text": "late, text", "late_goal_limited": "limits"},
    **{"moving_0.1": "0.1 m/s", "moving_0.2": "0.2 m/s", "pair": "two", "goal_change": "moving goal"},
    **{"detour_unseen": "detour, unseen", "detour_moving": "moving", "detour_pair": "two"},
}
COMPARED = ("obstacle", "model", "source", "nmse_train", "nmse_test", "goal_max", "goal_mean")
COMPARED += ("late_goal_max", "obstacle_min", "obstacle_mean", "hits")
"""Columns of the tables that stand beside the dissertation's, in their order."""

Row = dict[str, Any]


def tables(results: ObstacleResults, published: Mapping[str, Any]) -> dict[str, Table]:
    """All tables by name, with those that the page links to as CSV only; `published` is the YAML."""
    keys = ["protocol", "speed_m_s", "rules", "model", "learned_from", "obstacle"]
    groups = results.found.scores.groupby(keys, sort=False)
    everything = [dict(zip(keys, key, strict=True)) | summary(rows) for key, rows in groups]
    frames = {
        "per_setting": per_setting(results, published["per_setting"]),
        "per_shape": per_shape(results, published["per_shape"]),
        "unseen": unseen(results, published["unseen"]),
        "fit": fit(results, published["largest_nmse"]),
        "limits": limits(results),
        "all_shapes": all_shapes(results),
        "hits": hits(results),
        "fit_per_scenario": results.fits,
        "detours": results.detours.rename_axis(["obstacles", "model", "learned_from"]).reset_index(),
        "summary": pd.DataFrame(everything),
    }
    return {name: Table(frame, FORMATS, HEADINGS, _strong(frame)) for name, frame in frames.items()}


def per_setting(results: ObstacleResults, printed: Mapping[str, Row]) -> pd.DataFrame:
    """Table IV.1: a model for each scenario."""
    rows = []
    for kind in (NO_MODEL, HUMAN_INSPIRED, NETWORK):
        source = "" if kind == NO_MODEL else SETTING
        rows += _beside(results, {"model": KINDS[kind].name}, printed[kind], TRAINED, kind, source)
    people = {PRINTED: printed["demonstrations"], HERE: summary(results.found.people)}
    name = DEMONSTRATIONS.name
    return _compared(rows + [{"model": name, "source": words} | its for words, its in people.items()])


def per_shape(results: ObstacleResults, printed: Mapping[str, Mapping[str, Row]]) -> pd.DataFrame:
    """Table IV.2: a network for the settings of each shape; `nmse_train` and `nmse_test` over y and z."""
    rows = []
    for shape in SHAPES:
        fits = {f"nmse_{part}": results.fit(NETWORK, shape, shape, part) for part in ("train", "test")}
        across = {name: row["nmse_across"] for name, row in fits.items()}
        for kind, source, nmse in ((NO_MODEL, "", {}), (NETWORK, shape, across)):
            labels = {"obstacle": shape, "model": KINDS[kind].name} | nmse
            rows += _beside(results, labels, printed[shape][kind], TRAINED, kind, source, shape)
    return _compared(rows)


def unseen(results: ObstacleResults, printed: Mapping[str, Row]) -> pd.DataFrame:
    """Table IV.3: networks past unseen spheres, by what they learned from."""
    rows = _beside(results, {"model": KINDS[NO_MODEL].name}, printed[NO_MODEL], UNSEEN, NO_MODEL, "")
    for shape in SHAPES:
        labels = {"model": model_name(NETWORK, shape)}
        rows += _beside(results, labels, printed[shape], UNSEEN, NETWORK, shape)
    return _compared(rows)


def fit(results: ObstacleResults, low: float) -> pd.DataFrame:
    """Figure IV.10 in numbers, of models that learned one scenario.

    Returns:
        Per `over` (which axes) and `model`: number of `scenarios`; `train_mean`, `test_mean` NMSE; how many
        scenarios have at most `low`, `train_low` and `test_low`.
    """
    rows = []
    for column, over in FITS.items():
        parts = {part: results.setting_fits(column, part) for part in ("train", "test")}
        for kind in (NETWORK, HUMAN_INSPIRED) if len(parts["test"]) else ():
            row: Row = {"over": over, "model": KINDS[kind].name, "scenarios": len(parts["test"])}
            row |= {f"{part}_mean": its[kind].mean() for part, its in parts.items()}
            rows.append(row | {f"{part}_low": int((its[kind] <= low).sum()) for part, its in parts.items()})
    return pd.DataFrame(rows)


def limits(results: ObstacleResults) -> pd.DataFrame:
    """Both kinds of post-processing side by side, on trained and unseen obstacles.

    Returns:
        Per `obstacles`, `model`: number of `unrolls`; `hits`, largest goal distances `goal` at the prescribed
        time and `late_goal` (m), each with `_text` for the rules of the text and `_limited`; `excursion`: the
        largest goal distance between these times (m), with limits; `restrained`: share of the samples at
        which the limits changed the coupling term.
    """
    families = {"per setting": (SETTING,), "per shape": SHAPES, "all shapes": (ALL,)}
    groups = [
        (protocol, kind, words) for protocol in (TRAINED, UNSEEN) for kind in KINDS for words in families
    ]
    rows = []
    for protocol, kind, words in groups:
        rules = {"text": PUBLISHED, "limited": LIMITED}
        found = {name: results.rows(protocol, kind, families[words], its) for name, its in rules.items()}
        count = len(found["limited"])
        if count == 0:
            continue
        row: Row = {"obstacles": protocol, "model": f"{KINDS[kind].name}, {words}", "unrolls": count}
        row |= {f"hits_{name}": int(its["hit"].sum()) for name, its in found.items()}
        for column in ("goal", "late_goal"):
            row |= {f"{column}_{name}": its[f"{column}_distance_m"].max() for name, its in found.items()}
        sources = found["limited"]["learned_from"].unique()
        row["excursion"] = results.excursions.loc[(protocol, kind)].loc[sources].max()
        rows.append(row | {"restrained": found["limited"]["restrained"].mean()})
    return pd.DataFrame(rows)


def all_shapes(results: ObstacleResults) -> pd.DataFrame:
    """A model of all shapes beside those of one shape, on the settings of each `obstacle`.

    Returns:
        Per `obstacle` and `model`: `nmse_x`, `nmse_y`, `nmse_z` held out, `hits`, `obstacle_min`, `goal_max`.
    """
    groups = [(shape, kind, source) for shape in SHAPES for kind in KINDS for source in (shape, ALL)]
    rows = []
    for shape, kind, source in groups:
        scored = results.rows(TRAINED, kind, source, obstacle=shape)
        if len(scored):
            row = {"obstacle": shape, "model": model_name(kind, source)}
            row |= results.fit(kind, source, shape)[["nmse_x", "nmse_y", "nmse_z"]].to_dict()
            rows.append(row | summary(scored))
    columns = ["obstacle", "model", "nmse_x", "nmse_y", "nmse_z", "hits", "obstacle_min", "goal_max"]
    return pd.DataFrame(rows)[columns]


def hits(results: ObstacleResults) -> pd.DataFrame:
    """Hits with limits at the goal, per model and situation on the grid of spheres.

    Returns:
        Per `model`: `unseen`, `moving_<speed>` per speed, `pair`, `goal_change`, and `closest`: the smallest
        obstacle distance of all of them; `detour_unseen`, `detour_moving`, `detour_pair`: mean of the largest
        distances from the reach without avoidance, m.
    """
    rows = []
    for kind, source in results.contenders:
        row: Row = {"model": model_name(kind, source)}
        every = {
            protocol: results.rows(protocol, kind, source) for protocol in SITUATIONS if protocol != TRAINED
        }
        for protocol, its in every.items():
            for speed, count in its.groupby("speed_m_s")["hit"].sum().items():
                row[f"{protocol}_{speed:g}" if protocol == MOVING else protocol] = int(count)
        row["closest"] = min(its["obstacle_distance"].min() for its in every.values())
        detours = results.detours["mean"]
        row |= {f"detour_{name}": detours.get((name, kind, source)) for name in (UNSEEN, MOVING, PAIR)}
        rows.append(row)
    return pd.DataFrame(rows)


def _beside(
    results: ObstacleResults,
    labels: Row,
    printed: Row,
    protocol: str,
    kind: str,
    source: str,
    obstacle: str | None = None,
) -> list[Row]:
    """Rows of a model: as printed, and with either rules; without coupling term these are one."""
    rules = {LIMITED: HERE} if kind == NO_MODEL else {its: f"{HERE}, {words}" for its, words in RULES.items()}
    found = {words: results.rows(protocol, kind, source, its, obstacle) for its, words in rules.items()}
    here = [labels | {"source": words} | summary(scored) for words, scored in found.items()]
    return [labels | {"source": PRINTED} | printed, *here]


def _compared(rows: Sequence[Row]) -> pd.DataFrame:
    frame = pd.DataFrame(rows)
    return frame[[name for name in COMPARED if name in frame]]


def _strong(frame: pd.DataFrame) -> frozenset[int]:
    """Rows of unrolls with the text's rules: those are to be compared with what is printed."""
    sources = frame.get("source", pd.Series(dtype=str))
    return frozenset(row for row, words in enumerate(sources) if words == f"{HERE}, {RULES[PUBLISHED]}")
