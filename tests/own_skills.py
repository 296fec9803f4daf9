"""The example task's skill, learned from true cuts, for tests of what is done with a skill."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pandas as pd
import pytest
from rigid_body_robots import FINGERS

from dissertation.simulation.pick_and_place import MOVES, as_recording, takes
from structlearn.feedback.models.pmnn import open_loop
from structlearn.feedback.skill import ReactiveSkill, demonstrated_workspace
from structlearn.primitives.fitting import learn_sequence
from structlearn.readers import synchronise
from structlearn.tasks.movement import skill_check
from structlearn.tasks.movement.check_results import SkillCheck
from structlearn.tasks.movement.parameters import RobotParameters, TaskFitParameters

FIT = TaskFitParameters(
    smoothing_hz=5.0, kernel_count=25, regression="joint", scaled_axes=(True, False, False), frame="auto"
)
HERE = {"position_m": (0.0, 0.0, 0.0), "orientation": (1.0, 0.0, 0.0, 0.0)}
PANDA = RobotParameters(
    urdf="franka_panda/panda.urdf",
    tip="panda_grasptarget",
    locked_joints=FINGERS,
    base=HERE,
    tool=HERE,
    rest_configuration=(0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.8),
    max_acceleration=15.0,
    max_jerk=5000.0,
    least_singular_value=0.05,
    least_distance_m=0.01,
)


@lru_cache
def pick_skill(axes: tuple[str, ...] = ()) -> ReactiveSkill:
    """Reach and retreat of three demonstrations, with networks that correct the retreat on some axes."""
    demonstrations = [synchronise(as_recording(take), 200.0, 0.2) for take in takes(seed=1, moves=2, count=3)]
    names = pd.Index([one.name for one in demonstrations], name="demonstration")
    cuts = {
        name: pd.DataFrame([one.true_segments[place] for one in demonstrations], names, ["start_s", "end_s"])
        for place, name in enumerate(MOVES[2])
    }
    return ReactiveSkill(
        learn_sequence(demonstrations, cuts, FIT),
        networks={"retreat": {axis: open_loop(np.ones(25)) for axis in axes}} if axes else {},
        workspace=demonstrated_workspace([one.position for one in demonstrations], 0.02),
    )


def quick_check(skill: ReactiveSkill, robot: RobotParameters) -> SkillCheck:
    """`check_skill` at 50 samples per second, not 200, with looks at links every 0.1 s, not every 0.02 s."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(skill_check, "RATE_HZ", 50.0)
        patch.setattr(skill_check, "COLLISION_EVERY", 5)
        return skill_check.check_skill(skill, robot)


def slower(skill: ReactiveSkill, factor: float) -> ReactiveSkill:
    """The same with all durations times a factor."""
    primitives = []
    for one in skill.primitives:
        local = replace(one.position.local, duration=factor * one.duration)
        primitives.append(replace(one, position=replace(one.position, local=local)))
    return replace(skill, primitives=primitives)
