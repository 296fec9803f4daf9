"""Write a task's skill file for a robot: primitives, feedback, bounds and provenance."""

from dataclasses import replace
from typing import Any

from structlearn.core.artefacts import publish
from structlearn.core.errors import InputError
from structlearn.core.params import value_at
from structlearn.feedback.coupling_targets import sensor_channels
from structlearn.feedback.skill import ReactiveSkill, demonstrated_limits, demonstrated_workspace
from structlearn.feedback.skill_file import skill_provenance, write_skill
from structlearn.primitives.stiffness import suggested
from structlearn.readers.demonstration import OUTPUTS, joint_names
from structlearn.tasks.movement.feedback_learning import read_feedback
from structlearn.tasks.movement.parameters import MovementEntry
from structlearn.tasks.task_files import SKILL, TaskFiles, leave_out, run_for_task


def main(files: TaskFiles) -> None:
    own, learned = files.entry(MovementEntry), read_feedback(files.folder / "feedback")
    runs = files.runs("demonstrations", OUTPUTS)
    joints = joint_names(runs[0])
    workspace = demonstrated_workspace([run.position for run in runs], own.skill.workspace_margin_m, joints)
    named: dict[str, Any] = {
        "joints": joints,
        "outputs": runs[0].output_names,
        "digital": runs[0].digital_names,
    }
    try:
        skill = ReactiveSkill(files.primitives(), workspace=workspace, **named)
    except InputError as error:  # a primitive no controller can step, e.g. with a turn beyond half a circle
        with publish(files.folder / "skill") as folder:
            leave_out(folder, str(error))
        return
    if learned is not None and own.feedback is not None:
        targets = {axis: [by[axis].target for by in learned.datasets.values()] for axis in own.feedback.axes}
        skill = replace(
            skill,
            expected=learned.expected,
            networks=learned.networks,
            limits=demonstrated_limits(targets, own.skill),
            sensors=sensor_channels(own.feedback.sensors, learned.expected),
        )
    if own.stiffness is not None:
        profiles = {
            name: suggested(table.drop(columns="primitive").to_numpy(), own.stiffness)
            for name, table in files.table("primitives/spread").groupby("primitive", sort=False)
        }
        skill = replace(skill, stiffness=profiles)
    with publish(files.folder / "skill") as folder:
        folder.mkdir()
        values = value_at(files.parameters, "entry")
        bags = value_at(files.parameters, "files")
        write_skill(skill, folder / SKILL, skill_provenance([], values) | {"bags": bags})


if __name__ == "__main__":
    run_for_task(main, out="skill")
