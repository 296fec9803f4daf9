"""The dynamics of an arm on its task's page: models tested on held-out motion, and whether to trust them."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from structlearn.reporting.claims import Evidence
from structlearn.reporting.document import Table
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import interval, rounded
from structlearn.tasks.motion import motion_parameters as names
from structlearn.tasks.motion.motion_figures import PART_LOOKS, motion_figures, parts_panel
from structlearn.tasks.motion.motion_parameters import (
    AUTHORS,
    RANDOM,
    MotionParameters,
    PartsParameters,
    read_logs,
)
from structlearn.tasks.motion.motion_results import (
    BEST,
    BOUNDS,
    FRICTIONS,
    RIVALS,
    URDF,
    Drawn,
    MotionResults,
    chosen,
    model_words,
    motion_findings,
)
from structlearn.tasks.section import Section
from structlearn.tasks.shown_tables import shown
from structlearn.tasks.task_files import ABSENT, TaskFiles

CENTRE = [f"centre_{axis}_m" for axis in "xyz"]
# Parameters of a link that a page shows, and how they are written.
LINKS = {"mass_kg": ".2f"} | dict.fromkeys(CENTRE, ".3f") | {"viscous": ".2f", "coulomb": ".2f"}
WHOLE = {  # errors of all joints together: heading, and how they are written
    "limit_percent": ("NRMS (% of the limits)", ".3f"),
    "relative_percent": ("relative (%)", ".2f"),
    "norm_n_m": ("norm (N m)", ".2f"),
}
PROTOCOLS = {AUTHORS: "their protocol", RANDOM: "random choices"}


def section(files: TaskFiles) -> Section:
    """The dynamics of an arm: identified, checked against its URDF, by parts of the torque, or why not."""
    reason = files.folder / "motion" / ABSENT
    if reason.exists():
        facts = {"reason": reason.read_text(encoding="utf-8").strip()}
        return Section("unidentified", "The arm's dynamics", facts=facts)
    parameters = files.entry(MotionParameters)
    first, *_ = read_logs(files.recorded / "logs.parquet", parameters).values()
    tables = files.tables("motion")
    if parameters.parts is not None:
        return parts_section(tables, parameters.parts, first.provenance)
    if not parameters.structures:
        return Section(
            "motion",
            "Torques beside the URDF",
            "torque_check.html.jinja",
            lead="torque_check_lead.html.jinja",
            facts={"origin": first.provenance},
            find=check_findings(tables),
            tables={name: shown(tables[name]) for name in ("payload_torques", "payloads")}
            | {"motion_gravity": _gravity(tables["gravity"])},
        )
    results = MotionResults(tables, parameters)
    urdf = f"{files.folder}/motion/identified.urdf"
    return Section(
        "motion",
        "The arm's dynamics",
        facts=motion_facts(results) | {"urdf": urdf, "origin": first.provenance},
        find=motion_findings(results),
        tables=motion_tables(results),
        pictures=motion_figures(results),
    )


def motion_facts(results: MotionResults) -> dict[str, Any]:
    """Values for the sentences."""
    test, motions, gravity = results.test, results["motions"], results["gravity"]
    best, excitation = results.joint_nmse(results.tested, results.best), results["excitation"].iloc[0]
    worst = max(best, key=lambda joint: best[joint].value)
    named = motions[motions["log"].isin([results.train_log, results.tested])]
    seconds = (motions if results.parameters.train is None else named)[["learned_s", "tested_s"]].sum()
    carried = {log: results.carried(log)[1].evidence() for log in results.carried_logs}
    facts: dict[str, Any] = {
        "chosen": results.parameters,
        "logs": len(motions),
        "joints": len(results.joints),
        "friction": FRICTIONS[results.best[1]],
        "learned_s": seconds["learned_s"],
        "tested_s": seconds["tested_s"],
        "train_log": results.train_log,
        "tested": results.tested,
        "worst": best[worst].evidence(),
        "worst_joint": results.names[list(best).index(worst)],
        "best": test.loc[results.best].min(),
        "worst_of": {
            name: test.loc[key].max()
            for name, key in (("urdf", URDF), ("bounds", results.bounds), ("viscous", (BEST, "viscous")))
        },
        "condition": excitation["condition"],
        "base_parameters": int(excitation["parameters"]),
        "unsure": len(results["base"].query("low < 0 < high")),
        "blocks": best[worst].n,
        "gravity": {word: list(its["name"]) for word, its in gravity.groupby("holds")},
        "further": {
            log: tuple(results.errors[log].loc[key] for key in (results.best, results.bounds))
            for log in results.parts[2:]
        },
        "networks": [
            f"{model_words(key)} {rounded(results.errors['train'].loc[key].mean(), '.2g')} "
            f"\N{RIGHTWARDS ARROW} {rounded(test.loc[key].mean(), '.2g')}"
            for key in (*RIVALS, ("delan", "coulomb"))
            if key in test.index
        ],
        "carried": carried,
        "first": next(iter(carried), None),
    }
    if "gains" in results and results.parameters.drives is not None:
        gains, stand_in = results["gains"].set_index("joint"), results.parameters.drives.assumed_gains
        facts["gain_factors"] = gains["quoted"] / gains["found"]
        facts["stand_in"] = {joint: stand_in[joint] for joint in gains.index[gains["assumed"]]}
        facts["rest_log"] = results.rest_log()
    if carried:
        facts["largest_empty_kg"] = chosen(results["carried"], stage=names.EMPTY)["mass_kg"].abs().max()
    return facts


def check_findings(tables: Mapping[str, pd.DataFrame]) -> Findings:
    """Of logs that are too slow to identify an arm."""
    find, signs = Findings("joints"), {-1: "reversed", 1: "as_recorded"}
    left = chosen(tables["payload_torques"], payload=True).groupby("sign")["left_n_m"]
    payloads = tables["payloads"].set_index("sign")["mass_kg"]
    worst = {word: (left.max()[sign], left.size()[sign]) for sign, word in signs.items()}
    find.exact("torque_left", worst, unit="N m", headline=True)
    find.exact(
        "payload", {word: (payloads[sign], 1) for sign, word in signs.items()}, unit="kg", headline=True
    )
    return find


def motion_tables(results: MotionResults) -> dict[str, Table]:
    """Tables keyed by name."""
    wide, best, tested = results.test, results.best, results.tested
    joints = {"joint": results.joints, "name": results.names} | {
        model_words(key): [_text(its, ".2g") for its in results.joint_nmse(tested, key).values()]
        for key in (URDF, results.bounds, best)
    }
    errors = wide.add_prefix("joint_").assign(mean=wide.mean(axis=1)).reset_index(drop=True)
    errors.insert(0, "model", [model_words(key) for key in wide.index])
    plain = frozenset(np.flatnonzero(wide.index.get_level_values("model") == BOUNDS).tolist())
    whole, frictions = [], dict.fromkeys(("coulomb", "offset", best[1]))
    for key in (URDF, *((kind, friction) for friction in frictions for kind in (BOUNDS, BEST))):
        found = results.whole_errors(key)
        texts = {heading: _text(found[name], number) for name, (heading, number) in WHOLE.items()}
        whole.append({"model": model_words(key)} | texts)
    words = {"start_s": "from (s)", "end_s": "to (s)", "length_s": "length (s)"}
    words |= {"learned_s": "learned from (s)", "tested_s": "tested on (s)"}
    tables = {
        "motion_joints": Table(pd.DataFrame(joints)),
        "motion_errors": shown(errors, plain),
        "motion_whole": Table(pd.DataFrame(whole)),
        "motion_logs": Table(results["motions"][["log", "part", *words]], dict.fromkeys(words, ".1f"), words),
        "motion_gravity": _gravity(results["gravity"]),
        "motion_base": shown(results["base"].rename(columns={"urdf": "URDF"})),
        "motion_fitness": shown(results["fitness"]),
        "motion_determined": shown(results["determined"]),
        "motion_bodies": _bodies(results),
    }
    further = [
        {"log": log, "model": model_words(key)} | results.errors[log].loc[key].add_prefix("joint_").to_dict()
        for log in results.parts[2:]
        for key in (URDF, *RIVALS, best, results.bounds)
        if key in results.errors[log].index
    ]
    if further:
        tables["motion_further"] = shown(pd.DataFrame(further))
    if "choice" in results:
        tables["motion_choice"] = shown(results["choice"])
    if "gains" in results:
        tables["motion_drives"] = _drives(results)
    if results.carried_logs:
        tables |= {"motion_loads": _loads(results), "motion_followed": _followed(results)}
    return tables


def _text(found: Drawn, number: str) -> str:
    if np.isnan(found.value):
        return "none"
    its = found.evidence()
    return f"{rounded(its.value, number)} {interval(its.low, its.high, number)}"


def _gravity(gravity: pd.DataFrame) -> Table:
    words = {"name": "joint", "gravity_n_m": "URDF's gravity, std (N m)", "torque_n_m": "torque, std (N m)"}
    words |= {"share": "share of gravity in the torque", "holds": "contains gravity"}
    return Table(gravity[list(words)], dict.fromkeys(("gravity_n_m", "torque_n_m", "share"), ".2f"), words)


def _bodies(results: MotionResults) -> Table:
    """Links as written, a column per parameter, with half a 95 % interval where fits were drawn."""
    its, text = results["bodies"], []
    its = its[its["parameter"].isin(list(LINKS))]
    for row in its.itertuples():
        form = LINKS[row.parameter]
        width = f" ± {row.half_width:{form}}" if np.isfinite(row.half_width) else ""
        text.append(f"{rounded(row.value, form)}{width}")
    wide = its.assign(text=text).pivot_table("text", "link", "parameter", "first", sort=False)
    urdf = its[its["parameter"] == "mass_kg"].set_index("link")["urdf"]
    frame = wide.assign(urdf_mass_kg=[rounded(urdf[link], ".2f") for link in wide.index]).reset_index()
    table = shown(frame)
    words = {"urdf_mass_kg": "URDF's mass (kg)", "viscous": "viscous (N m s/rad)", "coulomb": "Coulomb (N m)"}
    return Table(frame, table.formats, {**table.headings, **words})


def _drives(results: MotionResults) -> Table:
    """Gains and delays of every joint, with intervals as text."""
    rows, rest = [], results.rest_log()
    for row in results["gains"].itertuples():
        its = {"joint": row.joint, "quoted": rounded(row.quoted, ".2f")}
        if rest is not None:
            at_rest = results.drive(names.AT_REST, row.joint, rest)
            its["at rest"] = "assumed" if row.assumed else _text(at_rest, ".3f")
        its["used"] = rounded(row.found, ".3f")
        for log, words in ((results.train_log, "learned from"), (results.tested, "tested on")):
            its[f"in motion, {words}"] = _text(results.drive(names.IN_MOTION, row.joint, log), ".3f")
            its[f"delay (ms), {words}"] = _text(results.drive(names.DELAY, row.joint, log), ".1f")
        rows.append(its)
    return Table(pd.DataFrame(rows))


def _loads(results: MotionResults) -> Table:
    rows = [
        {
            "logs": row.pair,
            "gains": row.gains,
            "mass (kg)": _text(results.load_kg(row.pair, row.gains), ".3f"),
            "error (%)": _text(results.load_error(row.pair, row.gains), ".1f"),
            "centre (m)": ", ".join(rounded(getattr(row, name), ".3f") for name in CENTRE),
        }
        for row in results["loads"].itertuples()
    ]
    return Table(pd.DataFrame(rows))


def _followed(results: MotionResults) -> Table:
    assert results.parameters.load is not None
    step_s, rows = results.parameters.load.batch / results.parameters.rate_hz, []
    for log in results.carried_logs:
        masses, error = results.carried(log)
        row = {"log": log, "settled_s": len(masses) * step_s, "mass_kg": masses.mean()}
        row |= {"least_kg": masses.min(), "most_kg": masses.max()}
        its = error.evidence()
        rows.append(row | {"error (%)": f"{rounded(its.value, '.1f')} {interval(its.low, its.high)}"})
    return shown(pd.DataFrame(rows), settled_s=".0f", least_kg=".2f", most_kg=".2f")


def parts_section(
    tables: Mapping[str, pd.DataFrame], parameters: PartsParameters, origin: Mapping[str, str]
) -> Section:
    """Of a task whose logs have the parts of their torques: findings are errors over those published."""
    find, published = Findings("trainings"), parameters.published
    rows: dict[str, dict[str, Any]] = {
        name: {"part": name, "published": f"{value:.2g}"} for name, value in published.items()
    }
    for (model, protocol), its in tables["parts"].groupby(["model", "protocol"], sort=False):
        errors = {name: one.to_numpy() for name, one in its.groupby("measure")["error"]}
        ratios = {name: errors[name] / value for name, value in published.items()}
        name, make = f"{model}_{protocol}", find.exact if len(errors["torque"]) == 1 else find.mean
        found = make(
            name, {part: its.item() for part, its in ratios.items()} if make == find.exact else ratios
        )
        assert not isinstance(found, Evidence), "there is a row per part"
        for part, one in found.items():
            texts = [rounded(published[part] * one.value, ".1e")]
            if one.low < one.high:
                texts.append(interval(published[part] * one.low, published[part] * one.high, ".1e"))
            rows[part][f"{PART_LOOKS[model].name}, {PROTOCOLS[protocol]}"] = " ".join(texts)
    power = tables["parts"].query("model == 'delan' and protocol == @RANDOM and measure == 'power'")
    worst = power.loc[power["error"].idxmax()]
    find.among("random choices").exact("worst_power", worst["error"] / published["power"], len(power))
    planar = tables["planar"]
    lengths = planar["length_m"]
    find.among("fits").counted("possible_links", int(planar["possible"].sum()), len(planar))
    find.among("fits").exact("length_m", lengths.median(), len(planar), unit="m")
    find.among("fits").exact("length_spread_m", np.ptp(lengths), len(planar), unit="m")
    return Section(
        "parts",
        "Parts of the torque",
        "torque_parts.html.jinja",
        lead="torque_parts_lead.html.jinja",
        facts={"chosen": parameters, "origin": origin, "worst": worst["left_out"].split()},
        find=find,
        tables={"torque_parts": Table(pd.DataFrame(rows.values()))},
        pictures={"torque_parts": parts_panel(tables["parts"], published)},
    )
