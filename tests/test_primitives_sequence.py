import json

import numpy as np
import pytest
from committed import committed
from primitives_movements import for_few_rngs, random_orientations, random_vectors, reach, wobbly_turn

from structlearn.core import artefacts, quaternion
from structlearn.core.errors import InputError
from structlearn.primitives import primitive_files, sequence
from structlearn.primitives.orientation import QuaternionPrimitive, fit_quaternion
from structlearn.primitives.position import fit_position
from structlearn.primitives.sequence import PoseGoal, PosePrimitive, fit_orientation
from structlearn.primitives.twist_swing import TwistSwingPrimitive, fit_twist_swing
from structlearn.primitives.vector import fit_vector

DT = 1 / 300
POINTS = np.array([[0.0, 0.0, 0.3], [0.0, 0.0, 0.05], [0.3, 0.1, 0.05], [0.3, 0.3, 0.25]])
TURNS = {"short": (0.8, -0.6, 1.0), "mixed": (0.8, 1.7 * 2 * np.pi, -1.0), "full": (7.0, -11.0, 7.0)}


def learned(rng, turns=None):
    """Three primitives; with turns also orientations, each from where the last one ended."""
    primitives = []
    base = random_orientations(rng)
    for i in range(3):
        duration = rng.uniform(0.8, 2.0)
        orientation = None
        if turns is not None:
            demonstrated = wobbly_turn(rng, turns[i], 0.15, duration, DT, base, rng.normal(size=3))
            base = demonstrated.orientation[-1]
            orientation = fit_orientation([demonstrated])
        points = reach(rng, POINTS[i], POINTS[i + 1], duration, DT, detour=0.03)
        primitives.append(PosePrimitive(f"part {i + 1}", fit_position([points]), orientation))
    return primitives


def new_situation(rng, primitives):
    turn = quaternion.from_rotation_vector(random_vectors(rng, 0.3))
    goals = sequence.moved_goals(sequence.default_goals(primitives), rng.uniform(-0.1, 0.1, 3), turn)
    return {"goals": goals, "durations": [rng.uniform(0.5, 2.0) * p.duration for p in primitives]}


@pytest.mark.parametrize("turns", TURNS.values(), ids=TURNS)
@pytest.mark.parametrize("moved", [False, True])
@for_few_rngs
def test_no_signal_jumps_at_a_switch(turns, moved, rng):
    primitives = learned(rng, turns)
    situation = new_situation(rng, primitives) if moved else {}
    whole = sequence.unroll(primitives, DT, **situation)
    for count in (1, 2):  # the end of a shorter sequence is the predecessor's own last sample
        shorter = {name: values[:count] for name, values in situation.items()}
        part = sequence.unroll(primitives[:count], DT, **shorter)
        switch = whole.switches[count]
        assert switch == part.switches[-1]
        for pose in ("position", "orientation"):
            for name, signal in vars(getattr(whole, pose)).items():  # eq. IV.12-14
                predecessor, scale = getattr(getattr(part, pose), name)[-1], np.abs(signal).max()
                np.testing.assert_allclose(signal[switch], predecessor, atol=1e-6 * scale)


@pytest.mark.parametrize(
    ("turn_deg", "form"),
    [(150, QuaternionPrimitive), (170, TwistSwingPrimitive), (-400, TwistSwingPrimitive)],
)
def test_the_form_follows_from_the_largest_net_turn(turn_deg, form):
    rng = np.random.default_rng(0)
    demonstrated = [wobbly_turn(rng, turn, 0.0) for turn in np.radians([20.0, turn_deg])]
    assert isinstance(fit_orientation(demonstrated), form)


def test_moved_goals_are_shifted_and_turned_in_the_base_frame():
    turn = quaternion.from_rotation_vector([0.0, 0.0, np.pi / 2])
    tilted = quaternion.from_rotation_vector([1.0, 0.0, 0.0])
    goal, bare = sequence.moved_goals([PoseGoal(np.ones(3), tilted), PoseGoal(np.ones(3))], [1, 2, 3], turn)
    np.testing.assert_allclose(goal.position, [2, 3, 4])
    expected = quaternion.product(quaternion.from_rotation_vector([0.0, 1.0, 0.0]), turn)
    np.testing.assert_allclose(goal.orientation, expected, atol=1e-14)
    assert bare.orientation is None


@for_few_rngs
def test_a_generalised_sequence_is_the_sequence_in_its_new_situation(rng):
    turn_deg, factor = rng.uniform(-180.0, 180.0), rng.uniform(0.3, 3.0)
    primitives = learned(rng, TURNS["short"])
    start, goal = (tuple(values) for values in rng.uniform(-0.1, 0.1, size=(2, 3)))
    changes = {"goal_turn_deg": turn_deg, "duration_factor": factor}
    changes |= {"start_offset_m": start, "goal_offset_m": goal}
    path = sequence.generalised(
        primitives, DT, committed(sequence.GeneraliseParameters, "generalise", **changes)
    )
    np.testing.assert_allclose(path.position.position[0], primitives[0].position.start + start)
    np.testing.assert_allclose(path.orientation.orientation[0], primitives[0].orientation.start)
    assert path.switches[-1] == sum(round(factor * primitive.duration / DT) for primitive in primitives)
    np.testing.assert_allclose(path.position.position[-1], primitives[-1].position.goal + goal, atol=0.01)


@pytest.mark.parametrize("turns", [None, TURNS["short"]])
def test_the_table_holds_the_path_and_gives_a_switch_to_the_successor(turns):
    path = sequence.unroll(learned(np.random.default_rng(0), turns), DT)
    table = sequence.sequence_table(path, ["a", "b", "c"])
    assert list(table.primitive.iloc[path.switches]) == ["a", "b", "c", "c"]
    assert (table.primitive.iloc[path.switches[1:3] - 1] == ["a", "b"]).all()
    np.testing.assert_array_equal(table[["x", "y", "z"]], path.position.position)
    np.testing.assert_array_equal(table[["ax", "ay", "az"]], path.position.acceleration)
    if turns is None:
        assert "qw" not in table
    else:
        np.testing.assert_array_equal(table[["qw", "qx", "qy", "qz"]], path.orientation.orientation)
        np.testing.assert_array_equal(table[["dwx", "dwy", "dwz"]], path.orientation.angular_acceleration)


STEP = 0.01


def stored_primitives(oriented=True):
    rng = np.random.default_rng(0)
    primitives = []
    reaches = {"approach": [0.0, 0.1, 0.9], "scrape along": [0.8, 0.1, 0.1], "stay": [0.0, 0.0, 0.001]}
    for name, goal in reaches.items():
        fit = fit_twist_swing if name == "scrape along" else fit_quaternion
        demonstrated = wobbly_turn(rng, 1.0, dt=STEP, base=random_orientations(rng))
        position = fit_position(
            [reach(rng, np.zeros(3), goal, dt=STEP, detour=0.0)], scaled=(True, False, False)
        )
        primitives.append(PosePrimitive(name, position, fit([demonstrated]) if oriented else None))
    return primitives


def expected_traces():
    rng = np.random.default_rng(1)
    return fit_vector([reach(rng, np.zeros(19), np.ones(19), dt=STEP)], scaled=[True] * 10 + [False] * 9)


@pytest.mark.parametrize("oriented", [True, False])
def test_stored_primitives_unroll_bit_for_bit_as_before(tmp_path, oriented):
    primitives = stored_primitives(oriented)
    primitive_files.write_primitives(primitives, tmp_path / "p.safetensors")
    found = primitive_files.read_primitives(tmp_path / "p.safetensors")
    assert [primitive.name for primitive in found] == ["approach", "scrape along", "stay"]
    assert [primitive.position.frame for primitive in found] == ["side", "up", "world"]
    before, after = sequence.unroll(primitives, STEP), sequence.unroll(found, STEP)
    np.testing.assert_array_equal(after.switches, before.switches)
    poses = ("position", "orientation") if oriented else ("position",)
    for pose in poses:
        for name, values in vars(getattr(before, pose)).items():
            np.testing.assert_array_equal(getattr(getattr(after, pose), name), values)
    assert oriented or after.orientation is None


def test_a_stored_vector_primitive_unrolls_bit_for_bit_as_before(tmp_path):
    primitive, path = expected_traces(), tmp_path / "traces.safetensors"
    primitive_files.write_vector_primitive(primitive, path, "expected traces")
    found = primitive_files.read_vector_primitive(path)
    assert artefacts.read_description(path) == "expected traces"
    assert type(found.duration) is float
    for name, values in vars(primitive.unroll(STEP)).items():
        np.testing.assert_array_equal(getattr(found.unroll(STEP), name), values)


CLAIM = {"pose_primitives": [{"name": "a", "frame": "up", "orientation": "quaternion"}]}
READERS = {
    "pose primitives": (
        primitive_files.read_primitives,
        lambda path: primitive_files.write_vector_primitive(expected_traces(), path, "traces"),
    ),
    "vector primitive": (
        primitive_files.read_vector_primitive,
        lambda path: primitive_files.write_primitives(stored_primitives(), path),
    ),
}


@pytest.mark.parametrize("kind", READERS)
def test_a_foreign_file_is_named(tmp_path, kind):
    """Also one of the other kind, and one that claims to hold what it does not."""
    read, write_other = READERS[kind]
    write_other(tmp_path / "other")
    for name, description in (("network", "a network"), ("list", "[1, 2]"), ("claim", json.dumps(CLAIM))):
        artefacts.write_tensors({"layer.weights": np.ones(3)}, tmp_path / name, description)
    for path in tmp_path.iterdir():
        with pytest.raises(InputError, match=rf"{path.name}: holds no {kind}"):
            read(path)
