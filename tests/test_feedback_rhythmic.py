"""The controller runs rhythmic primitives from its tables: any number of strokes, stopped early, moved."""

import copy

import numpy as np
import pytest
from own_skills import FIT
from test_segmentation_strokes import SEGMENT, wiped

from structlearn.core.artefacts import read_description, read_tensors, write_tensors
from structlearn.core.errors import InputError
from structlearn.feedback.cpp_export import header
from structlearn.feedback.runtime import Controller
from structlearn.feedback.skill import ReactiveSkill, demonstrated_workspace
from structlearn.feedback.skill_file import read_skill, write_skill
from structlearn.primitives.fitting import learn_sequence
from structlearn.primitives.sequence import default_start, unroll
from structlearn.segmentation.segments import cut

RATE_HZ = 200.0


@pytest.fixture(scope="module")
def skill() -> ReactiveSkill:
    runs = wiped()
    workspace = demonstrated_workspace([run.position for run in runs], 0.05)
    return ReactiveSkill(learn_sequence(runs, cut(runs, SEGMENT).results, FIT), workspace=workspace)


def with_cycles(skill: ReactiveSkill, cycles: float) -> ReactiveSkill:
    reach, wipe, retreat = skill.primitives
    return ReactiveSkill([reach, wipe.repeated(cycles), retreat], workspace=skill.workspace)


def started(skill: ReactiveSkill) -> Controller:
    controller, start = Controller(skill, RATE_HZ), default_start(skill.primitives)
    controller.start(start.position, start.orientation)
    return controller


def ticked(controller: Controller, until=lambda controller: controller.finished) -> np.ndarray:
    """(T, 7) position, acceleration and phase of every tick."""
    rows = []
    while not until(controller):
        controller.tick(None)
        rows.append([*controller.position, *controller.acceleration, controller.phase])
    return np.array(rows)


@pytest.mark.parametrize("cycles", [1.0, 2.0, 4.5])
def test_the_controller_makes_as_many_strokes_as_the_skill_says(skill, cycles):
    chosen = with_cycles(skill, cycles)
    found = ticked(started(chosen))
    path = unroll(chosen.primitives, 1.0 / RATE_HZ).position
    np.testing.assert_allclose(found[:, :3], path.position, atol=1e-9)
    jumps = np.abs(np.diff(found[:, 3:6], axis=0)).max()
    assert jumps < 0.1 * np.abs(found[:, 3:6]).max()


def test_strokes_are_stopped_early_without_a_jump(skill):
    chosen = with_cycles(skill, 20.0)
    controller = started(chosen)
    assert controller.stop_strokes() == 0  # it reaches
    ticked(controller, lambda controller: controller.primitive == 1)
    assert controller.stop_strokes() == 0  # the first stroke has only begun
    first_cycles = round(2.2 * RATE_HZ * chosen.primitives[1].duration / 20.0)
    for _ in range(first_cycles):
        controller.tick(None)
    assert controller.phase < 1.0
    other = copy.deepcopy(controller)
    assert controller.stop_strokes() == 17  # of the 17.8 cycles that are left, all but the last transient
    assert controller.stop_strokes() == 0
    rest = ticked(controller)
    jumps = np.abs(np.diff(rest[:, 3:6], axis=0)).max()
    assert jumps < 0.1 * np.abs(rest[:, 3:6]).max()
    whole = ticked(other)
    cycles = (len(whole) - len(rest)) / RATE_HZ / (chosen.primitives[1].duration / 20.0)
    assert cycles == pytest.approx(17.0, abs=0.01)
    np.testing.assert_allclose(rest[-1, :3], whole[-1, :3], atol=1e-3)


def test_a_moved_goal_shifts_all_strokes(skill):
    controller, still = started(skill), started(skill)
    for each in (controller, still):
        ticked(each, lambda controller: controller.primitive == 1)
    offset = np.array([0.01, 0.02, 0.01])
    controller.move_goal("wipe", skill.primitives[1].position.goal + offset)
    paths = [
        ticked(each, lambda controller: controller.primitive == 2)[:, :3] for each in (controller, still)
    ]
    moved = paths[0] - paths[1]
    np.testing.assert_allclose(moved[0], 0.0, atol=1e-4)
    np.testing.assert_allclose(moved[len(moved) // 2 :] - offset, 0.0, atol=1e-3)


def test_the_file_keeps_the_rhythm(skill, tmp_path):
    path = tmp_path / "skill.safetensors"
    write_skill(skill, path, {})
    again = read_skill(path)
    assert again.primitives[1].rhythm == skill.primitives[1].rhythm
    np.testing.assert_array_equal(ticked(started(again)), ticked(started(skill)))


@pytest.mark.parametrize(
    "rhythm", [[0.0, 0.0], [0.0, 1e-300], [0.0, np.nan], [np.nan, 1.0], [0.0, 1e9], [0.0, 1.0, 2.0]]
)
def test_a_damaged_rhythm_is_refused(skill, tmp_path, rhythm):
    path = tmp_path / "skill.safetensors"
    write_skill(skill, path, {})
    tensors = read_tensors(path) | {"primitives.wipe.position.local.rhythm": np.array(rhythm)}
    write_tensors(tensors, path, read_description(path))
    with pytest.raises(InputError, match="rhythm"):
        read_skill(path)


def test_the_header_for_cpp_does_not_know_strokes(skill):
    with pytest.raises(InputError, match="'wipe' is rhythmic, which the C\\+\\+ header does not know"):
        header(skill, "skill_wipe", "of a test")
