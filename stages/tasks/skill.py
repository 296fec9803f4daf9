"""Put what was learned of a task into one file for a robot: primitives, feedback, bounds, origin."""

from structlearn.core.artefacts import publish
from structlearn.feedback.coupling_targets import sensor_channels
from structlearn.feedback.skill import ReactiveSkill, demonstrated_limits, demonstrated_workspace
from structlearn.feedback.skill_file import SkillParameters, provenance, write_skill
from structlearn.tasks.own.protocol.own_feedback import read_own_feedback
from structlearn.tasks.task_entry import OwnFeedbackParameters
from structlearn.tasks.task_files import SKILL, TaskFiles, run_for_task


def main(files: TaskFiles) -> None:
    parameters, learned = files.part("skill", SkillParameters), read_own_feedback(files.folder / "feedback")
    paths = [one.position for one in files.runs("demonstrations")]
    workspace = demonstrated_workspace(paths, parameters.workspace_margin_m)
    skill = ReactiveSkill(files.primitives(), workspace=workspace)
    if learned is not None:
        chosen = files.part("feedback", OwnFeedbackParameters)
        targets = {axis: [by[axis].target for by in learned.datasets.values()] for axis in chosen.axes}
        skill = ReactiveSkill(
            skill.primitives,
            learned.expected,
            learned.networks,
            demonstrated_limits(targets, parameters),
            workspace,
            sensor_channels(chosen.sensors, learned.expected),
        )
    with publish(files.folder / "skill") as folder:
        folder.mkdir()
        values, digests = files.values()
        write_skill(skill, folder / SKILL, provenance([], values) | {"bags": digests})
    with publish(files.skill) as link:
        link.symlink_to(f"skill/{SKILL}")


if __name__ == "__main__":
    run_for_task(main, out="skill")
