"""A UR10e and its load: gains of its drives, models tested on another motion, a known mass."""

import numpy as np
import pandas as pd

from structlearn.reporting.claims import UNKNOWN
from structlearn.reporting.document import Table
from structlearn.reporting.prose import interval, rounded
from structlearn.tasks.public.page.parts.part import Part, of
from structlearn.tasks.public.page.parts.ur10e_figures import ur10e_pictures
from structlearn.tasks.public.page.parts.ur10e_results import (
    BEST,
    BOUNDS,
    RIVALS,
    Ur10eResults,
    chosen,
    model_words,
    ur10e_evidence,
    ur10e_metrics,
)
from structlearn.tasks.public.page.recorded_results import RecordedResults
from structlearn.tasks.public.page.recorded_tables import shown
from structlearn.tasks.public.public_files import SETS

KEY = "recorded_ur10e"

MOTIONS = ["log", "part", "start_s", "end_s", "length_s"]
"""Columns of the table of motions that are shown."""

NUMBERS = {"mass_kg": ".2f", "viscous": ".1f", "coulomb": ".1f"}
"""How parameters of a link are written; others with three digits behind the point."""


def found(results: RecordedResults) -> Ur10eResults:
    """Output of the stage, with its parameters."""
    return Ur10eResults(results.of_set("ur10e_"), results.parameters[KEY])


def facts(results: RecordedResults) -> dict[str, object]:
    """Values for its sentences, under one name."""
    return {"ur10e": ur10e_facts(found(results))}


def ur10e_facts(results: Ur10eResults) -> dict[str, object]:
    """Beside the metrics."""
    own = results.parameters
    train, test, gains = results.errors["train"], results.test, results["gains"]
    carried = {log: results.carried_error(log).evidence() for log in results.load_logs}
    first = next(iter(carried), None)
    load = results.load("all pairs", "found").evidence() if first else UNKNOWN
    choice, empty = results["choice"], chosen(results["carried"], stage="empty, another motion")
    return {
        "chosen": own,
        "load_kg": results.of_load.known_kg,
        "settled_s": results.of_load.settled_s,
        "worst": test.loc[BEST].max(),
        "best": test.loc[BEST].min(),
        "worst_least_squares": test.loc[BOUNDS].max(),
        "worst_viscous": test.loc["cov", "viscous"].max(),
        "rivals": [
            f"{model_words(key)} {rounded(train.loc[key].mean(), '.2g')} \N{RIGHTWARDS ARROW} "
            f"{rounded(test.loc[key].mean(), '.2g')}"
            for key in (*RIVALS, ("delan", "coulomb"))
        ],
        "load": load,
        "carried": carried,
        "first": first,
        "settled": first is not None and bool(np.isfinite(carried[first].value)),
        "largest_empty_kg": empty["mass_kg"].abs().max(),
        "quoted_percent": results.load("all pairs", "quoted").value if first else np.nan,
        "gain_factors": gains["quoted"] / gains["found"],
        "stand_in": {
            joint: results.of_drives.assumed_gains[joint]
            for joint in gains.loc[gains["assumed"], "joint"].tolist()
        },
        "further_worst": {log: results.errors[log].loc[BEST] for log in results.further},
        "further_bounds": {log: results.errors[log].loc[BOUNDS] for log in results.further},
        "choice": {
            row.kind: f"{row.hidden} nodes, rate {row.rate:g}, {row.epochs} epochs"
            for row in choice[choice["chosen"]].itertuples()
        },
    }


def ur10e_tables(results: Ur10eResults) -> dict[str, Table]:
    """Tables keyed by name."""
    return {
        "ur10e_nmse": _errors(results, results.tested),
        "ur10e_nmse_further": _further(results),
        "ur10e_motions": shown(results["motions"][MOTIONS], start_s=".1f", end_s=".1f", length_s=".1f"),
        "ur10e_joints": _joints(results),
        "ur10e_weighed": _weighed(results),
        "ur10e_followed": _followed(results),
        "ur10e_choice": shown(results["choice"]),
        "ur10e_inertias": _inertias(results),
    }


def _errors(results: Ur10eResults, part: str) -> Table:
    wide = results.errors[part]
    numbers = wide.add_prefix("joint_").assign(mean=wide.mean(axis=1)).reset_index(drop=True)
    numbers.insert(0, "model", [model_words(key) for key in wide.index])
    plain = frozenset(np.flatnonzero(wide.index.get_level_values("model") == "least_squares").tolist())
    return shown(numbers, plain)


def _further(results: Ur10eResults) -> Table:
    rows = [
        {"log": log, "model": model_words(key)} | results.errors[log].loc[key].add_prefix("joint_").to_dict()
        for log in results.further
        for key in (("urdf", "none"), *RIVALS, BEST, BOUNDS)
    ]
    return shown(pd.DataFrame(rows))


def _joints(results: Ur10eResults) -> Table:
    """Gains and delays of every joint, with intervals as text."""
    rows = []
    for row in results["gains"].itertuples():
        its = {"joint": row.joint, "quoted": rounded(row.quoted, ".2f")}
        if (rest := results.of_drives.rest) is not None:
            its["at rest"] = "assumed" if row.assumed else _text(results, "gain at rest", rest, row.joint)
        its["used"] = rounded(row.found, ".3f")
        for log, words in ((results.train, "learned from"), (results.tested, "asked about")):
            its[f"in motion, {words}"] = _text(results, "gain in motion", log, row.joint)
            its[f"delay (ms), {words}"] = _text(results, "delay", log, row.joint, 1e3, ".1f")
        rows.append(its)
    return Table(pd.DataFrame(rows))


def _text(
    results: Ur10eResults, quantity: str, log: str, joint: int, scale: float = 1.0, number: str = ".3f"
) -> str:
    its = results.drive(quantity, log, joint, scale).evidence()
    if np.isnan(its.value):
        return "none"
    return f"{rounded(its.value, number)} {interval(its.low, its.high, number)}"


def _weighed(results: Ur10eResults) -> Table:
    rows = []
    for row in results["loads"].itertuples():
        its = results.load(row.pair, row.gains).evidence()
        low, _, high = results.load_kg(its)
        rows.append(
            {
                "logs": row.pair,
                "gains": row.gains,
                "mass (kg)": f"{rounded(row.mass_kg, '.3f')} {interval(low, high, '.3f')}",
                "error (%)": f"{rounded(its.value, '.1f')} {interval(its.low, its.high)}",
                "centre (m)": ", ".join(rounded(getattr(row, f"centre_{axis}_m"), ".3f") for axis in "xyz"),
            }
        )
    return Table(pd.DataFrame(rows))


def _followed(results: Ur10eResults) -> Table:
    rows = []
    for log in results.load_logs:
        its, error = results.settled(log), results.carried_error(log).evidence()
        rows.append(
            {
                "log": log,
                "settled_s": float(len(its) * results.of_load.batch / results.parameters.rate_hz),
                "mass_kg": its["mass_kg"].mean(),
                "least_kg": its["mass_kg"].min(),
                "most_kg": its["mass_kg"].max(),
                "error (%)": f"{rounded(error.value, '.1f')} {interval(error.low, error.high)}",
            }
        )
    return shown(pd.DataFrame(rows), settled_s=".0f", least_kg=".2f", most_kg=".2f")


def _inertias(results: Ur10eResults) -> Table:
    """Links as they are written, with intervals, a column per parameter."""
    its = results["bodies"]
    its = its[~its["parameter"].str.startswith("i")]
    text = [
        f"{rounded(row.value, form := NUMBERS.get(row.parameter, '.3f'))} ± {row.half_width:{form}}"
        for row in its.itertuples()
    ]
    wide = its.assign(text=text).pivot_table(
        index="link", columns="parameter", values="text", aggfunc="first", sort=False
    )
    maker = its[its["parameter"] == "mass_kg"].set_index("link")["urdf"]
    frame = wide.assign(maker=[rounded(maker[link], ".2f") for link in wide.index]).reset_index()
    headings = {"maker": "maker's mass (kg)", "viscous": "viscous (N m s/rad)", "coulomb": "Coulomb (N m)"}
    table = shown(frame)
    return Table(frame, table.formats, {**table.headings, **headings})


PART = Part(
    name="ur10e",
    heading="A UR10e and its load",
    page="ur10e",
    needs=tuple(f"ur10e_{table}" for table in SETS["ur10e"]),
    parameters=(KEY,),
    metrics=of(found, ur10e_metrics),
    evidence=of(found, ur10e_evidence),
    facts=facts,
    tables=of(found, ur10e_tables),
    pictures=of(found, ur10e_pictures),
)
