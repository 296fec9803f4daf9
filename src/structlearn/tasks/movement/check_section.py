"""Page section "On the robot": whether the task's robot can execute the skill, and with which margins."""

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.core.errors import InputError
from structlearn.feedback.coupling import unit
from structlearn.feedback.skill import JOINT_MARGIN
from structlearn.feedback.skill_file import SkillParameters, read_skill
from structlearn.palette import CATEGORICAL_COLOURS, GREY, LIGHT_GREY
from structlearn.primitives.sequence import default_start, unroll
from structlearn.primitives.transformation import ALPHA, BETA
from structlearn.reporting.document import Table
from structlearn.reporting.figure_style import WIDTH, canvas, styled
from structlearn.reporting.findings import Findings
from structlearn.tasks.movement.check_results import (
    KINDS,
    THIN,
    UNCHECKED,
    SkillCheck,
    overall,
    read_check,
)
from structlearn.tasks.movement.feedback_learning import in_view
from structlearn.tasks.movement.parameters import MovementEntry
from structlearn.tasks.movement.skill_check import RATE_HZ
from structlearn.tasks.section import Section, shown
from structlearn.tasks.task_files import ABSENT, TaskFiles

WORST = ["quantity", "kind", "run", "where", "value", "bound", "unit", "time_s", "margin_share", "verdict"]


def check_section(files: TaskFiles) -> Section | None:
    """Section for tasks with a robot."""
    robot = files.entry(MovementEntry).robot
    if robot is None or not files.skill.exists():
        return None
    check = read_check(files.folder / "check")
    kinds = [kind for kind in KINDS if kind in set(check.margins["kind"])]
    by_quantity = check.margins.pivot_table(
        "margin", "quantity", "kind", "min", sort=False, observed=True, dropna=False
    )[kinds].reset_index()
    by_quantity.insert(1, "verdict", verdicts(check, "quantity", by_quantity["quantity"]))
    worst = check.worst("quantity", "kind").rename(columns={"margin": "margin_share"})
    by_run = check.worst("run").rename(columns={"margin": "margin_share"})
    by_run = by_run.assign(verdict=verdicts(check, "run", by_run["run"]))
    return Section(
        "check",
        "On the robot",
        facts=check.metrics()
        | {
            "robot": robot,
            "rest": check.rest,
            "notes": check.notes,
            "failing": list(check.failing["quantity"].unique()),
            "faults": check.faults,
            "advice": check.advice,
            "tried": len(check.tried),
            "kinds": kinds,
            "searched": robot.rest_configuration is None,
            "of_joints": files.entry(MovementEntry).of_joints,
        },
        find=Findings.of_metrics(check.metrics(), ("check_failing_runs", "check_least_margin")),
        tables={
            "check": Table(by_quantity, dict.fromkeys(kinds, ".0%")),
            "check_worst": shown(worst[WORST]),
            "check_runs": shown(by_run[["kind", "run", "quantity", "where", "margin_share", "verdict"]]),
        }
        | ({"check_tried": shown(check.tried)} if len(check.tried) else {}),
        pictures={"check_margins": margins_figure(check.margins, kinds)},
    )


@styled
def margins_figure(margins: pd.DataFrame, kinds: list[str]) -> Figure:
    """Margins of every quantity in every run, by kind of run."""
    figure = canvas(2.9, WIDTH)
    panel = figure.subplots()
    places = {name: place for place, name in enumerate(reversed(list(margins["quantity"].unique())))}
    panel.axvspan(0.0, 100.0 * THIN, color=LIGHT_GREY, linewidth=0.0)
    panel.axvline(0.0, color=GREY)
    shifts = np.linspace(0.27, -0.27, len(KINDS))
    for kind, colour, shift in zip(kinds, CATEGORICAL_COLOURS, shifts, strict=False):
        rows = margins[margins["kind"] == kind]
        shown = 100.0 * np.clip(rows["margin"], -1.0, 1.0)
        panel.scatter(shown, rows["quantity"].map(places) + shift, 12, colour, linewidths=0.0, label=kind)
    panel.set(yticks=list(places.values()), yticklabels=list(places), xlabel="margin (%)")
    panel.legend(ncols=len(kinds), loc="lower left", bbox_to_anchor=(0.0, 1.0))
    return figure


def verdicts(check: SkillCheck, by: str, keys: pd.Series) -> pd.Series:
    """Overall verdict for each value of a column."""
    return keys.map(check.margins.groupby(by, sort=False)["verdict"].agg(overall))


def skill_section(files: TaskFiles) -> Section:
    """Section on the skill: its workspace and coupling bounds, or why there is none."""
    if not files.skill.exists():
        reason = (files.folder / "skill" / ABSENT).read_text(encoding="utf-8").strip()
        return Section("skill", "The skill", facts={"absent": reason})
    skill, parameters = read_skill(files.skill), files.entry(SkillParameters, "skill")
    workspace = skill.workspace
    if workspace is None:
        raise InputError(f"{files.skill}: has no workspace")
    start = default_start(skill.primitives).position
    corners = {"from_m": workspace.low, "to_m": workspace.high, "mean_start_m": start}
    box: dict[str, Any] = {"axis": list("xyz")} | corners
    if skill.joints:
        sampled = unroll(skill.primitives, 1.0 / RATE_HZ).position.velocity
        fastest = np.abs(sampled).max(axis=0)
        box = {"joint": skill.joints, "from": workspace.low, "to": workspace.high, "mean_start": start}
        box["fastest_per_s"] = fastest
    bounds = []
    for axis in skill.axes:
        largest, (factor, word) = skill.limits.largest_coupling[axis], in_view(axis)
        held = factor * largest / (ALPHA * BETA)
        bounds.append({"axis": axis, "largest_coupling_term": largest, "unit": unit(axis)})
        bounds[-1] |= {"displacement_if_held": held, "its_unit": word}
    return Section(
        "skill",
        "The skill",
        facts={
            "absent": "",
            "path": str(files.skill),
            "duration_s": sum(primitive.duration for primitive in skill.primitives),
            "margin_m": parameters.workspace_margin_m,
            "sensors": skill.sensors,
            "fade_s": skill.limits.fade_s,
            "axes": skill.axes,
            "joints": skill.joints,
            "margin_share": JOINT_MARGIN,
            "unchecked": () if files.has("robot") else UNCHECKED,
            "outputs": (*skill.outputs, *skill.digital),
        },
        tables={"skill_workspace": shown(pd.DataFrame(box))}
        | ({"skill_bounds": shown(pd.DataFrame(bounds))} if bounds else {}),
    )
