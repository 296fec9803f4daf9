"""The skill: its file, its bounds, and how a robot runs it."""

import pandas as pd

from structlearn.feedback.coupling import unit
from structlearn.feedback.skill_file import SkillParameters, read_skill
from structlearn.ground.errors import InputError
from structlearn.primitives.sequence import default_start
from structlearn.reporting.document import Table
from structlearn.testbeds.own.files import TaskFiles
from structlearn.testbeds.own.page.section import Section


def section(files: TaskFiles) -> Section:
    """Of a task with demonstrations."""
    skill, parameters = read_skill(files.skill), files.part("skill", SkillParameters)
    workspace = skill.workspace
    if workspace is None:
        raise InputError(f"{files.skill}: has no workspace")
    box = pd.DataFrame(
        {
            "axis": list("xyz"),
            "low_m": workspace.low,
            "high_m": workspace.high,
            "start_m": default_start(skill.primitives).position,
        }
    )
    bounds = [(axis, skill.limits.largest_coupling[axis], unit(axis)) for axis in skill.axes]
    headings = {"low_m": "from (m)", "high_m": "to (m)", "start_m": "mean start (m)"}
    return Section(
        "skill",
        "The skill",
        "skill.html.jinja",
        facts={
            "path": str(files.skill),
            "duration_s": sum(primitive.duration for primitive in skill.primitives),
            "margin_m": parameters.workspace_margin_m,
            "sensors": skill.sensors,
            "fade_s": skill.limits.fade_s,
            "axes": skill.axes,
        },
        tables={
            "skill_workspace": Table(box, dict.fromkeys(headings, ".3f"), headings),
            "skill_bounds": Table(
                pd.DataFrame(bounds, columns=["axis", "largest", "unit"]),
                {"largest": ".3g"},
                {"largest": "largest coupling term"},
            ),
        },
    )
