"""On the robot: whether the task's robot can do what the skill may ask of it, and with which margins."""

import pandas as pd

from structlearn.reporting.document import Table
from structlearn.testbeds.own.files import TaskFiles
from structlearn.testbeds.own.page.section import Section
from structlearn.testbeds.own.protocol.check_results import KINDS, SkillCheck, overall, read_check
from structlearn.testbeds.own.protocol.robot_parameters import RobotParameters

HEADINGS = {
    "where": "joint or links",
    "unit": "",
    "margin": "margin (%)",
    "time_s": "at (s)",
    "run": "run",
}
FORMATS = {"value": ".3g", "bound": ".3g", "margin": ".0f", "time_s": ".2f"}


def section(files: TaskFiles) -> Section:
    """Of a task with a robot."""
    check, robot = read_check(files.folder / "check"), files.part("robot", RobotParameters)
    return Section(
        "check",
        "On the robot",
        "check.html.jinja",
        facts=check.metrics()
        | {
            "robot": robot,
            "rest": {joint: f"{value:.2f}" for joint, value in check.rest.items()},
            "notes": check.notes,
            "failing": list(check.failing["quantity"].unique()),
            "kinds": [kind for kind in KINDS if kind in set(check.margins["kind"])],
            "searched": robot.rest_configuration is None,
        },
        metrics=check.metrics(),
        tables={
            "check": by_quantity(check),
            "check_worst": worst(check),
            "check_runs": by_run(check),
        },
    )


def by_quantity(check: SkillCheck) -> Table:
    """The least margin of each quantity by kind of run, and a verdict over all."""
    least = check.margins.pivot_table(
        "margin", "quantity", "kind", "min", sort=False, observed=True, dropna=False
    )
    kinds = [kind for kind in KINDS if kind in least]
    verdicts = check.margins.groupby("quantity", sort=False)["verdict"].agg(overall)
    frame = (100.0 * least[kinds]).assign(verdict=verdicts).reset_index()
    return Table(frame, dict.fromkeys(kinds, ".0f"), {kind: f"{kind} (%)" for kind in kinds})


def worst(check: SkillCheck) -> Table:
    """Where and when each kind of run is nearest to the bound of each quantity."""
    columns = ["quantity", "kind", "run", "where", "value", "bound", "unit", "time_s", "margin", "verdict"]
    return _percent(check.worst("quantity", "kind")[columns])


def by_run(check: SkillCheck) -> Table:
    """What each run is nearest to."""
    verdicts = check.margins.groupby("run", sort=False)["verdict"].agg(overall)
    frame = check.worst("run")[["kind", "run", "quantity", "where", "margin"]]
    return _percent(frame.assign(verdict=frame["run"].map(verdicts)))


def _percent(frame: pd.DataFrame) -> Table:
    return Table(frame.assign(margin=100.0 * frame["margin"]), FORMATS, HEADINGS)
