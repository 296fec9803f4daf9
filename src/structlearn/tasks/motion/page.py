"""Page section on an arm's dynamics: models tested on held-out motion, and whether to trust them."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from structlearn.core.metrics import matching
from structlearn.reporting.document import Table
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import rounded
from structlearn.tasks.motion import parameters as names
from structlearn.tasks.motion.differing_motion import REFITTED
from structlearn.tasks.motion.motion_figures import motion_figures, torque_check_panels
from structlearn.tasks.motion.motion_results import (
    BEST,
    BOUNDS,
    FRICTIONS,
    RIVALS,
    URDF,
    MotionResults,
    differing_losses,
    model_words,
    motion_findings,
    stated,
)
from structlearn.tasks.motion.parameters import BLOCK_S, MotionParameters, read_task_logs
from structlearn.tasks.section import Section, shown
from structlearn.tasks.task_files import ABSENT, TaskFiles

# Link parameters shown on the page, with their number formats
LINKS = {"mass_kg": ".2f"} | dict.fromkeys(names.CENTRE, ".3f") | {"viscous": ".2f", "coulomb": ".2f"}
WHOLE = {  # errors over all joints: heading and number format
    "limit_percent": ("NRMS (% of the limits)", ".3f"),
    "relative_percent": ("relative (%)", ".2f"),
    "norm_n_m": ("norm (N m)", ".2f"),
}
LOGS = {"start_s": "from (s)", "end_s": "to (s)", "length_s": "length (s)"}
LOGS |= {"learned_s": "learned from (s)", "tested_s": "tested on (s)"}


def sections(files: TaskFiles) -> list[Section]:
    """The section on an arm's dynamics."""
    return [dynamics_section(files)]


def dynamics_section(files: TaskFiles) -> Section:
    """An arm's dynamics, identified or checked against the URDF; or why they are not."""
    reason = files.folder / "motion" / ABSENT
    if reason.exists():
        facts = {"reason": reason.read_text(encoding="utf-8").strip()}
        return Section("unidentified", "The arm's dynamics", facts=facts)
    parameters = files.entry(MotionParameters)
    first, *_ = read_task_logs(files.recorded / "logs.parquet", parameters).values()
    tables = files.tables("motion")
    if not parameters.structures:
        return Section(
            "motion",
            "Torques compared with the URDF",
            "torque_check.html.jinja",
            lead="torque_check_lead.html.jinja",
            facts={"origin": first.provenance, "impossible": _impossible(tables)},
            find=check_findings(tables),
            tables={name: shown(tables[name]) for name in ("payload_torques", "payloads")}
            | {"motion_gravity": _gravity(tables["gravity"])},
            pictures={"payload_torques": torque_check_panels(tables["payload_torques"])},
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
    """Values for the sentences; `its`: all tables, with the names of logs, joints and models in them."""
    test, motions, excitation = results.test, results["motions"], results["excitation"].iloc[0]
    best = results.joint_nmse(results.tested, results.best)
    worst = max(best, key=lambda joint: best[joint].value)
    if results.parameters.train is not None:
        motions = motions[motions["log"].isin([results.train_log, results.tested])]
    facts: dict[str, Any] = {
        "its": results,
        "block_s": BLOCK_S,
        "chosen": results.parameters,
        "friction": FRICTIONS[results.best[1]],
        "seconds": motions[["learned_s", "tested_s"]].sum(),
        "impossible": _impossible(results),
        "repeated": results["repeats"].query("repeated").to_dict("records"),
        "worst": best[worst].evidence(),
        "worst_joint": results.names[list(best).index(worst)],
        "best": test.loc[results.best].min(),
        "worst_of": {
            name: test.loc[key].max()
            for name, key in (("urdf", URDF), ("bounds", results.bounds), ("viscous", (BEST, "viscous")))
        },
        "condition": excitation["condition"],
        "largest_condition": names.LARGEST_CONDITION,
        "base_parameters": int(excitation["parameters"]),
        "unsure": len(results["base"].query("low < 0 < high")),
        "lacks_gravity": [
            name for word in ("no", "doubtful") for name in matching(results["gravity"], holds=word)["name"]
        ],
        "networks": [
            f"{model_words(key)} {rounded(results.errors['train'].loc[key].mean(), '.2g')} "
            f"\N{RIGHTWARDS ARROW} {rounded(test.loc[key].mean(), '.2g')}"
            for key in (*RIVALS, ("delan", "coulomb"))
            if key in test.index
        ],
        "carried": {log: results.carried(log)[1].evidence() for log in results.carried_logs},
    }
    if "differing" in results:
        _, removed = differing_losses(results)
        facts["differing"] = results["differing"].iloc[0]
        facts["removed"] = {name: shares.mean() for name, shares in removed.items()}
        facts["most_removed"] = max(REFITTED, key=lambda name: facts["removed"][name])
    if "gains" in results and results.parameters.drives is not None:
        gains, substitutes = results["gains"].set_index("joint"), results.parameters.drives.assumed_gains
        facts["gain_factors"] = gains["quoted"] / gains["found"]
        facts["substitutes"] = {joint: substitutes[joint] for joint in gains.index[gains["assumed"]]}
        facts["rest_log"] = results.rest_log()
    if results.carried_logs:
        facts["largest_empty_kg"] = matching(results["carried"], stage=names.EMPTY)["mass_kg"].abs().max()
    return facts


def _impossible(tables: Mapping[str, pd.DataFrame]) -> list[str]:
    """Samples that were left out, one line per log, signal and joint."""
    return tables["impossible"]["text"].tolist() if "impossible" in tables else []


def check_findings(tables: Mapping[str, pd.DataFrame]) -> Findings:
    """Findings on logs that are too slow to identify an arm."""
    find, signs = Findings("joints"), {-1: "reversed", 1: "as_recorded"}
    left = matching(tables["payload_torques"], payload=True).groupby("sign")["left_n_m"]
    payloads = tables["payloads"].set_index("sign")["mass_kg"]
    worst = {word: (left.max()[sign], left.size()[sign]) for sign, word in signs.items()}
    find.exact("torque_left", worst, unit="N m", headline=True)
    masses = {word: payloads[sign] for sign, word in signs.items()}
    find.exact("payload", masses, unit="kg", headline=True)
    return find


def motion_tables(results: MotionResults) -> dict[str, Table]:
    """Tables keyed by name."""
    wide, best, further = results.test, results.best, results.parts[2:]
    joints = {"joint": results.joints, "name": results.names} | {
        model_words(key): [drawn.text(".2g") for drawn in results.joint_nmse(results.tested, key).values()]
        for key in (URDF, results.bounds, best)
    }
    errors = wide.add_prefix("joint_").assign(mean=wide.mean(axis=1)).reset_index(drop=True)
    errors.insert(0, "model", [model_words(key) for key in wide.index])
    plain = frozenset(np.flatnonzero(wide.index.get_level_values("model") == BOUNDS).tolist())
    frictions = dict.fromkeys(("coulomb", "offset", best[1]))
    whole = [
        {"model": model_words(key)}
        | {WHOLE[name][0]: drawn.text(WHOLE[name][1]) for name, drawn in results.whole_errors(key).items()}
        for key in (URDF, *((kind, friction) for friction in frictions for kind in (BOUNDS, BEST)))
    ]
    tables = {
        "motion_joints": Table(pd.DataFrame(joints)),
        "motion_errors": shown(errors, plain),
        "motion_whole": Table(pd.DataFrame(whole)),
        "motion_logs": Table(results["motions"][["log", "part", *LOGS]], dict.fromkeys(LOGS, ".1f"), LOGS),
        "motion_gravity": _gravity(results["gravity"]),
        "motion_base": shown(results["base"].rename(columns={"urdf": "URDF"})),
        "motion_fitness": shown(results["fitness"]),
        "motion_determined": shown(results["determined"]),
        "motion_bodies": _bodies(results),
    }
    if further:
        rows = [
            {"log": log, "model": model_words(key)} | errors.loc[key].add_prefix("joint_").to_dict()
            for log, errors in ((log, results.errors[log]) for log in further)
            for key in (URDF, *RIVALS, best, results.bounds)
            if key in errors.index
        ]
        tables["motion_further"] = shown(pd.DataFrame(rows))
    if "differing" in results:
        tables["motion_differing"] = _differing(results)
    if "choice" in results:
        tables["motion_choice"] = shown(results["choice"])
    if "gains" in results:
        tables["motion_drives"] = _drives(results)
    if results.carried_logs:
        tables |= {"motion_loads": _loads(results), "motion_followed": _followed(results)}
    return tables


def _differing(results: MotionResults) -> Table:
    """Errors on motion that differs, by joint and by what was fitted to it."""
    wide = results.losses.reset_index(drop=True)
    wide.insert(0, "joint", results.joints)
    wide.insert(1, "NMSE", results["differing"]["nmse"].iloc[: len(wide)])  # as learned
    return Table(wide, {"NMSE": ".2g"} | dict.fromkeys(results.losses, ".3f"))


def _gravity(gravity: pd.DataFrame) -> Table:
    words = {"name": "joint", "gravity_n_m": "URDF's gravity, std (N m)", "torque_n_m": "torque, std (N m)"}
    words |= {"share": "share of gravity in the torque", "holds": "contains gravity"}
    return Table(gravity[list(words)], dict.fromkeys(("gravity_n_m", "torque_n_m", "share"), ".2f"), words)


def _bodies(results: MotionResults) -> Table:
    """Links of the written URDF, one column per parameter, with 95 % half-widths if there are draws."""
    bodies = results["bodies"]
    bodies = bodies[bodies["parameter"].isin(list(LINKS))]
    text = [
        rounded(row.value, LINKS[row.parameter])
        + (f" ± {row.half_width:{LINKS[row.parameter]}}" if np.isfinite(row.half_width) else "")
        for row in bodies.itertuples()
    ]
    wide = bodies.assign(text=text).pivot_table("text", "link", "parameter", "first", sort=False)
    urdf = bodies[bodies["parameter"] == "mass_kg"].set_index("link")["urdf"]
    table = shown(wide.assign(urdf_mass_kg=[rounded(urdf[link], ".2f") for link in wide.index]).reset_index())
    words = {"urdf_mass_kg": "URDF's mass (kg)", "viscous": "viscous (N m s/rad)", "coulomb": "Coulomb (N m)"}
    return replace(table, headings={**table.headings, **words})


def _drives(results: MotionResults) -> Table:
    """Gains and delays of every joint, with intervals as text."""
    rows, rest = [], results.rest_log()
    for row in results["gains"].itertuples():
        cells = {"joint": row.joint, "quoted": rounded(row.quoted, ".2f")}
        if rest is not None:
            at_rest = results.drive(names.AT_REST, row.joint, rest)
            cells["at rest"] = "assumed" if row.assumed else at_rest.text(".3f")
        cells["used"] = rounded(row.found, ".3f")
        for log, words in ((results.train_log, "learned from"), (results.tested, "tested on")):
            cells[f"in motion, {words}"] = results.drive(names.IN_MOTION, row.joint, log).text(".3f")
            cells[f"delay (ms), {words}"] = results.drive(names.DELAY, row.joint, log).text(".1f")
        rows.append(cells)
    return Table(pd.DataFrame(rows))


def _loads(results: MotionResults) -> Table:
    rows = [
        {
            "logs": row.pair,
            "gains": row.gains,
            "mass (kg)": results.load_kg(row.pair, row.gains).text(".3f"),
            "error (%)": results.load_error(row.pair, row.gains).text(".1f"),
            "centre (m)": ", ".join(rounded(getattr(row, name), ".3f") for name in names.CENTRE),
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
        rows.append(row | {"error (%)": stated(error.evidence(), ".1f")})
    return shown(pd.DataFrame(rows), settled_s=".0f", least_kg=".2f", most_kg=".2f")
