"""Feedback of strokes over the cycle's phase: learned from wiping that people corrected on a tilted table."""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import pytest
from own_skills import FIT
from test_segmentation_strokes import SEGMENT, wiped

from dissertation.simulation import wiping
from dissertation.simulation.pick_and_place import FORCE_N, as_recording
from structlearn.core.errors import InputError
from structlearn.core.params import merged
from structlearn.feedback.corrected_paths import SAMPLES, corrected_paths
from structlearn.feedback.coupling import orientation_target, reach_target
from structlearn.feedback.coupling_dataset import from_axes_table, to_axes_table
from structlearn.feedback.coupling_targets import executed_primitive
from structlearn.feedback.runtime import Controller
from structlearn.feedback.skill import ReactiveSkill, demonstrated_limits, demonstrated_workspace
from structlearn.feedback.skill_file import SkillParameters, read_skill, write_skill
from structlearn.primitives.fitting import in_phase, learn_sequence
from structlearn.primitives.sequence import PosePrimitive, default_start
from structlearn.readers import synchronise
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.segments import cut, execution_cuts
from structlearn.tasks.kinds import kind_defaults
from structlearn.tasks.movement.feedback_learning import LEVEL, LearnedFeedback, learn_feedback
from structlearn.tasks.movement.parameters import TaskFeedbackParameters

RATE_HZ = 100.0
NOISE_N = FORCE_N * np.array([1.0, 1.0, 1.0, 0.1, 0.1, 0.1])
LEARNED, NEW = (-5.0, 5.0), -3.0  # degrees of tilt
PARAMETERS = TaskFeedbackParameters.model_validate(
    merged(
        kind_defaults("movement")["feedback"],
        {
            "executions": "executions",
            "corrections": "corrections",
            "settings": [f"{tilt:g}" for tilt in LEARNED],
            "primitives": ["wipe"],
            "axes": ["z"],
            "sensors": ["wrench"],
            "hidden": [],
            "training": {"steps": 1000, "dropout": 0.0},
        },
    )
)


@dataclass
class Wiping:
    """What was learned from a person's wiping, and the executions."""

    primitives: list[PosePrimitive]
    level: list[Demonstration]
    corrected: dict[str, list[Demonstration]]
    feedback: LearnedFeedback

    @property
    def edge(self) -> np.ndarray:
        """(3,) m where the skill starts to wipe."""
        return self.primitives[1].position.start

    def skill(self) -> ReactiveSkill:
        """With bounds of what was corrected."""
        targets = {"z": [self.feedback.datasets["wipe"]["z"].target]}
        limits = demonstrated_limits(targets, SkillParameters(**kind_defaults("movement")["skill"]))
        workspace = demonstrated_workspace([run.position for run in self.level], 0.1)
        learned = self.feedback.expected, self.feedback.networks
        return ReactiveSkill(self.primitives, *learned, limits, workspace, (("wrench", 6),))


def felt(take, rng: np.random.Generator) -> Demonstration:
    """A take with the wrist's readings."""
    run = synchronise(as_recording(take), RATE_HZ, 0.2)
    force = [np.interp(run.time, take.time, axis) for axis in take.contact.T]
    wrench = np.column_stack([*force, *np.zeros((3, len(run.time)))])
    return replace(run, wrench=wrench + NOISE_N * rng.standard_normal(wrench.shape))


@pytest.fixture(scope="module")
def learned() -> Wiping:
    runs = wiped()
    primitives = learn_sequence(runs, cut(runs, SEGMENT).results, FIT)
    edge, rng = primitives[1].position.start, np.random.default_rng(3)

    def executed(tilt: float, count: int) -> list[Demonstration]:
        return [felt(take, rng) for take in wiping.executions(2, tilt, edge, count)]

    level, corrected = executed(0.0, 4), {f"{tilt:g}": executed(tilt, 3) for tilt in (*LEARNED, NEW)}
    feedback = learn_feedback(level, corrected, primitives, SEGMENT, PARAMETERS)
    return Wiping(primitives, level, corrected, feedback)


def missed_mm(learned: Wiping, tilt: float, cycles: float, feedback: bool) -> float:
    """RMS distance in mm from the table's surface while the controller wipes it, as the tool feels it."""
    skill, rng = learned.skill().repeated({"wipe": cycles}), np.random.default_rng(1)
    controller, start = Controller(skill, RATE_HZ, feedback=feedback), default_start(skill.primitives)
    controller.start(start.position, start.orientation)
    off = []
    while not controller.finished:
        force = wiping.contact_force(controller.position, controller.velocity, learned.edge, tilt)
        controller.tick(np.append(force, np.zeros(3)) + NOISE_N * rng.standard_normal(6))
        if controller.primitive == 1:
            surface = learned.edge[2] + wiping.height(controller.position, learned.edge, tilt)
            off.append(surface - controller.position[2])
    return 1e3 * float(np.sqrt(np.mean(np.square(off))))


@pytest.mark.parametrize("tilt", [NEW, -NEW])
@pytest.mark.parametrize("cycles", [1.0, 3.5, 5.0])  # people made 1.5 to 2.5
def test_feedback_follows_a_table_of_another_tilt_with_other_numbers_of_strokes(learned, tilt, cycles):
    without, corrected = (missed_mm(learned, tilt, cycles, feedback) for feedback in (False, True))
    assert without > 3.5
    assert corrected < 0.65 * without  # people leave 0.3 of it


def test_a_level_table_is_not_corrected(learned):
    """What the skill itself drifts off the table may be felt and corrected, nothing else."""
    assert missed_mm(learned, 0.0, 2.0, True) < missed_mm(learned, 0.0, 2.0, False) < 1.2
    scores = learned.feedback.scores.set_index("left_out")
    assert abs(scores.loc[LEVEL, "predicted"]) < 0.25 * abs(scores.loc["-3", "target"])


def test_coupling_targets_are_what_people_corrected(learned):
    """The targets add the height that a person took over, whatever the number of strokes."""
    dataset = learned.feedback.datasets["wipe"]["z"]
    paths = corrected_paths(dataset, SAMPLES)
    for tilt, run, correction in zip(paths.setting, paths.demonstration, paths.correction, strict=True):
        there = dataset.where((dataset.setting == tilt) & (dataset.demonstration == run))
        assert there.cycle is not None
        np.testing.assert_allclose(np.ptp(there.cycle), [1.5, 2.0, 2.5][run], atol=0.05)
        side = -0.5 * np.cos(2.0 * np.pi * np.interp(np.linspace(0, 1, SAMPLES), *progress(there)))
        height = np.tan(np.radians(float(tilt))) * wiping.STROKE[1] * side
        later = slice(SAMPLES // 4, None)  # once the correction is all there
        assert np.sqrt(np.mean((correction - wiping.TAKEN_OVER * height)[later] ** 2)) < 2e-3
    table = from_axes_table(to_axes_table(learned.feedback.datasets["wipe"]))["z"]
    np.testing.assert_array_equal(table.cycle, dataset.cycle)


def progress(dataset) -> tuple[np.ndarray, np.ndarray]:
    """Share of the time of one demonstration, and cycles."""
    return dataset.time / dataset.time[-1], dataset.cycle


def test_expected_traces_are_those_of_the_phase(learned):
    """Friction changes its sign with every stroke: at another phase it would deviate by its range."""
    take = wiping.executions(9, 0.0, learned.edge, 3)[2]
    run = felt(take, np.random.default_rng(4))
    cuts = in_phase(
        [run],
        execution_cuts([run], ["reach", "wipe", "retreat"], SEGMENT)["wipe"],
        learned.primitives[1],
        5.0,
    )
    _, deviation = executed_primitive(run, cuts.loc[run.name], learned.feedback.expected["wipe"], ["wrench"])
    friction = wiping.FRICTION * wiping.PAD_N_PER_M * wiping.PRESSED_M
    assert np.sqrt(np.mean(deviation[:, 1] ** 2)) < 0.2 * friction
    _, opposite = executed_primitive(
        run,
        cuts.loc[run.name] + pd.Series({"start_s": 0.0, "end_s": 0.0, "knots": np.array([0.0, 0.5])}),
        learned.feedback.expected["wipe"],
        ["wrench"],
    )
    assert np.sqrt(np.mean(opposite[:, 1] ** 2)) > friction


def test_runs_that_are_cut_on_their_own_count_as_the_primitive(learned):
    """A reference that begins on the other side shifts their cycles by half of one."""
    runs = learned.level[:2]
    found = execution_cuts(runs, ["reach", "wipe", "retreat"], SEGMENT)["wipe"]
    half = np.array([0.0, 0.5])
    shifted = found.assign(knots=[knots + half for knots in found["knots"]])
    for cuts in (found, shifted):
        again = in_phase(runs, cuts, learned.primitives[1], 5.0)
        assert [float(knots[0, 1] % 1.0) for knots in again["knots"]] == [0.0, 0.0]


def test_a_movement_may_start_elsewhere_in_its_cycle(learned):
    wipe = learned.primitives[1]
    other = wipe.repeated(2.0, first=0.5).position
    np.testing.assert_allclose(other.start - wipe.position.start, wiping.STROKE, atol=0.01)
    np.testing.assert_allclose(other.goal - other.start, 0.0, atol=0.01)


@pytest.mark.parametrize("cycles", [1.0, 2.5])
def test_a_primitive_with_its_coupling_target_is_the_corrected_path(learned, cycles):
    """As of discrete primitives (eq. IV.23, IV.24), in position and in orientation."""
    wipe, samples = learned.primitives[1].repeated(cycles), 200
    bumps = np.sin(np.linspace(0.0, 3.0 * np.pi, samples))[:, None] * [0.3, -0.2, 1.0]
    how = {"dt": wipe.duration / (samples - 1), "coupling": lambda k, x, xd: bumps[k]}
    found = reach_target(wipe.position.unroll(**how), wipe.position)
    np.testing.assert_allclose(found, bumps, atol=1e-9)
    found = orientation_target(wipe.orientation.unroll(**how), wipe.orientation)
    np.testing.assert_allclose(found, bumps, atol=1e-9)


def test_the_file_keeps_traces_and_networks(learned, tmp_path):
    path = tmp_path / "skill.safetensors"
    write_skill(learned.skill(), path, {})
    again = read_skill(path)
    assert again.expected["wipe"].rhythm == learned.feedback.expected["wipe"].rhythm
    assert again.sensors == (("wrench", 6),)


@pytest.mark.parametrize(
    ("cycles", "message"),
    [
        ({"wipe": 0.0}, "cycles of 'wipe': cycles and amplitude must be positive, are 0 and 1"),
        ({"wipe": float("nan")}, "cycles of 'wipe': cycles and amplitude must be positive"),
        ({"wipe": "three"}, "cycles of 'wipe': "),
        ({"reach": 2.0}, "cycles of 'reach': a discrete movement cannot be repeated"),
        ({"stir": 2.0}, "there is no primitive 'stir' among reach, wipe, retreat"),
    ],
)
def test_numbers_of_cycles_that_cannot_be_are_refused(learned, cycles, message):
    with pytest.raises(InputError, match=message):
        learned.skill().repeated(cycles)


def test_parts_of_a_skill_have_the_same_rhythm(learned):
    skill = learned.skill()
    discrete = replace(skill.expected["wipe"], rhythm=None)
    with pytest.raises(InputError, match="'wipe' or its expected traces have a rhythm, the other has none"):
        replace(skill, expected={"wipe": discrete})
    wipe = skill.primitives[1]
    other = replace(wipe, orientation=wipe.orientation.repeated(1.0))
    with pytest.raises(InputError, match="position and orientation of 'wipe' differ in their rhythms"):
        replace(skill, primitives=[skill.primitives[0], other, skill.primitives[2]])
