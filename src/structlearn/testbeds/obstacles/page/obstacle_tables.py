"""Tables of the obstacle testbed: published beside reproduced, and models beside models."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from structlearn.avoidance.learned_models import ALL, HUMAN_INSPIRED, NETWORK, PHASE_MODULATED, SETTING
from structlearn.avoidance.shapes import SHAPES
from structlearn.testbeds.obstacles.page import obstacle_published
from structlearn.testbeds.obstacles.page.obstacle_published import DEMONSTRATIONS, LARGEST_NMSE
from structlearn.testbeds.obstacles.page.obstacle_results import FITS, KINDS, ObstacleResults
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import (
    GOAL_CHANGE,
    LIMITED,
    MOVING,
    NO_MODEL,
    PAIR,
    PUBLISHED,
    TRAINED,
    UNSEEN,
)
from structlearn.testbeds.obstacles.protocol.avoidance_scores import summary

NAMES = {
    NO_MODEL: "no avoidance",
    HUMAN_INSPIRED: "Rai et al.",
    NETWORK: "network",
    PHASE_MODULATED: "phase-modulated network",
    DEMONSTRATIONS: "demonstrations",
}

SOURCES = {PUBLISHED: "here, as published", LIMITED: "here, limited"}
"""Where numbers come from, by the rules of post-processing."""

PRINTED = "dissertation"

SUMMARY = ("goal_max", "goal_mean", "late_goal_max", "obstacle_min", "obstacle_mean", "hits")
"""Columns of `evaluation.summary` that tables show."""


def model_name(kind: str, learned_from: str) -> str:
    """`network, sphere`: a kind of model and what it learned from."""
    named = {"": "", SETTING: ", per setting", ALL: ", all shapes"}.get(learned_from, f", {learned_from}")
    return f"{NAMES[kind]}{named}"


def tables(results: ObstacleResults) -> dict[str, pd.DataFrame]:
    """Tables of the page by name."""
    keys = ["protocol", "speed_m_s", "rules", "model", "learned_from", "obstacle"]
    groups = results.scores.groupby(keys, sort=False)
    everything = [dict(zip(keys, key, strict=True)) | summary(rows) for key, rows in groups]
    return {
        "per_setting": per_setting(results),
        "per_shape": per_shape(results),
        "unseen": unseen(results),
        "fit": fit(results),
        "fit_per_scenario": results.fits,
        "limits": limits(results),
        "all_shapes": all_shapes(results),
        "hits": hits(results),
        "detours": results.detours.rename_axis(["obstacles", "model", "learned_from"]).reset_index(),
        "summary": pd.DataFrame(everything),
    }


def per_setting(results: ObstacleResults) -> pd.DataFrame:
    """Table IV.1: columns `model`, `source` and `SUMMARY`."""
    rows = []
    for kind in (NO_MODEL, HUMAN_INSPIRED, NETWORK):
        rows.append(_row(NAMES[kind], PRINTED, obstacle_published.PER_SETTING[kind]))
        source = "" if kind == NO_MODEL else SETTING
        rows += _both_rules(results, NAMES[kind], TRAINED, kind, source)
    name = NAMES[DEMONSTRATIONS]
    rows.append(_row(name, PRINTED, obstacle_published.PER_SETTING[DEMONSTRATIONS]))
    rows.append(_row(name, "here", summary(results.people)))
    return pd.DataFrame(rows)


def per_shape(results: ObstacleResults) -> pd.DataFrame:
    """Table IV.2: columns `obstacle`, `model`, `source`, `nmse_train`, `nmse_test` (y and z), `SUMMARY`."""
    rows = []
    for shape in SHAPES:
        for kind in (NO_MODEL, NETWORK):
            source = "" if kind == NO_MODEL else shape
            printed = obstacle_published.PER_SHAPE[shape][kind]
            found = [_row(NAMES[kind], PRINTED, printed) | _fits(printed)]
            nmse = {}
            if kind == NETWORK:
                parts = {part: results.fit(kind, shape, shape, part) for part in ("train", "test")}
                nmse = {f"nmse_{part}": row["nmse_across"] for part, row in parts.items()}
            here = _both_rules(results, NAMES[kind], TRAINED, kind, source, shape)
            rows += [{"obstacle": shape} | row for row in found + [row | _fits(nmse) for row in here]]
    return pd.DataFrame(rows)[["obstacle", "model", "source", "nmse_train", "nmse_test", *SUMMARY]]


def unseen(results: ObstacleResults) -> pd.DataFrame:
    """Table IV.3: columns `model`, `source` and `SUMMARY`."""
    rows = []
    for source in ("", *SHAPES):
        kind = NETWORK if source else NO_MODEL
        name = model_name(kind, source)
        rows.append(_row(name, PRINTED, obstacle_published.UNSEEN[source]))
        rows += _both_rules(results, name, UNSEEN, kind, source)
    return pd.DataFrame(rows)


def fit(results: ObstacleResults) -> pd.DataFrame:
    """Figure IV.10 in numbers, of models that learned one scenario.

    Returns:
        Per `over` (which axes) and `model`: number of `scenarios`; `train_mean`, `test_mean` NMSE; how many
        scenarios have at most the published one, `train_low` and `test_low`.
    """
    rows = []
    for column, over in FITS.items():
        for kind in (NETWORK, HUMAN_INSPIRED):
            its = results.per_setting_fits[results.per_setting_fits["model"] == kind]
            parts = {part: its.loc[its["part"] == part, column].dropna() for part in ("train", "test")}
            row = {"over": over, "model": NAMES[kind], "scenarios": len(parts["test"])}
            row |= {f"{part}_mean": values.mean() for part, values in parts.items()}
            row |= {f"{part}_low": int((values <= LARGEST_NMSE).sum()) for part, values in parts.items()}
            rows.append(row)
    return pd.DataFrame(rows)


def limits(results: ObstacleResults) -> pd.DataFrame:
    """Both kinds of post-processing side by side, on trained and unseen obstacles.

    Returns:
        Per `obstacles`, `model`: number of `unrolls`; `hits`, largest goal distances `goal` at the prescribed
        time and `late_goal` (m), each with `_text` for the rules of the text and `_limited`; `excursion`: the
        largest goal distance between these times (m), with limits; `restrained`: share of the samples at
        which the limits changed the coupling term.
    """
    rows = []
    for protocol, kind, label, sources in _groups():
        found = {
            suffix: results.rows(protocol, kind, sources, rules)
            for suffix, rules in (("text", PUBLISHED), ("limited", LIMITED))
        }
        if found["limited"].empty:
            continue
        row = {"obstacles": protocol, "model": label, "unrolls": len(found["limited"])}
        row |= {f"hits_{suffix}": int(its["hit"].sum()) for suffix, its in found.items()}
        for name in ("goal", "late_goal"):
            row |= {f"{name}_{suffix}": its[f"{name}_distance_m"].max() for suffix, its in found.items()}
        row["excursion"] = results.excursion(protocol, kind, found["limited"]["learned_from"].unique())
        rows.append(row | {"restrained": found["limited"]["restrained"].mean()})
    return pd.DataFrame(rows)


def all_shapes(results: ObstacleResults) -> pd.DataFrame:
    """A model of all shapes beside those of one shape, on the settings of each shape.

    Returns:
        Per `obstacle` and `model`: `nmse_x`, `nmse_y`, `nmse_z` held out, `hits`, `obstacle_min`, `goal_max`.
    """
    rows = []
    for shape in SHAPES:
        for kind in KINDS:
            for source in (shape, ALL):
                scored = results.rows(TRAINED, kind, source, obstacle=shape)
                if len(scored):
                    fitted = results.fit(kind, source, shape)
                    numbers = summary(scored)
                    row = {"obstacle": shape, "model": model_name(kind, source)}
                    row |= {f"nmse_{axis}": fitted[f"nmse_{axis}"] for axis in "xyz"}
                    rows.append(row | {name: numbers[name] for name in ("hits", "obstacle_min", "goal_max")})
    return pd.DataFrame(rows)


def hits(results: ObstacleResults) -> pd.DataFrame:
    """Hits with limits on the goal, per model and situation on the grid of spheres.

    Returns:
        Per `model`: `unseen`, `moving_<speed>` per speed, `pair`, `goal_change`, and `closest`: the smallest
        obstacle distance of all of them; `detour_unseen`, `detour_moving`, `detour_pair`: mean of the largest
        distances from the reach without avoidance, m.
    """
    rows = []
    for kind, source in results.contenders:
        row: dict[str, object] = {"model": model_name(kind, source)}
        closest = []
        for protocol in (UNSEEN, MOVING, PAIR, GOAL_CHANGE):
            its = results.rows(protocol, kind, source)
            closest.append(its["obstacle_distance"].min())
            if protocol == MOVING:
                counts = its.groupby("speed_m_s")["hit"].sum()
                row |= {f"{protocol}_{speed:g}": int(count) for speed, count in counts.items()}
            else:
                row[protocol] = int(its["hit"].sum())
        row["closest"] = min(closest)
        for protocol in (UNSEEN, MOVING, PAIR):
            key = (protocol, kind, source)
            row[f"detour_{protocol}"] = np.nan if kind == NO_MODEL else results.detours.loc[key, "mean"]
        rows.append(row)
    return pd.DataFrame(rows)


def _groups() -> list[tuple[str, str, str, tuple[str, ...]]]:
    """Protocol, kind, label and sources of the rows of `limits`."""
    sources = {"per setting": (SETTING,), "per shape": SHAPES, "all shapes": (ALL,)}
    return [
        (protocol, kind, f"{NAMES[kind]}, {words}", its)
        for protocol in (TRAINED, UNSEEN)
        for kind in KINDS
        for words, its in sources.items()
    ]


def _both_rules(
    results: ObstacleResults,
    name: str,
    protocol: str,
    kind: str,
    learned_from: str,
    obstacle: str | None = None,
) -> list[dict[str, object]]:
    """Rows of a model with either rules; without coupling term there is nothing to post-process."""
    rules = {LIMITED: "here"} if kind == NO_MODEL else SOURCES
    return [
        _row(name, source, summary(results.rows(protocol, kind, learned_from, which, obstacle)))
        for which, source in rules.items()
    ]


def _row(model: str, source: str, numbers: Mapping[str, float]) -> dict[str, object]:
    return {"model": model, "source": source} | {name: numbers.get(name) for name in SUMMARY}


def _fits(numbers: Mapping[str, float]) -> dict[str, float | None]:
    return {name: numbers.get(name) for name in ("nmse_train", "nmse_test")}
