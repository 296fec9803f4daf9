import json

import numpy as np
import pytest
from primitives_movements import random_orientations, reach, wobbly_turn

from structlearn.core import artefacts
from structlearn.core.errors import InputError
from structlearn.primitives import primitive_files, sequence
from structlearn.primitives.orientation import fit_quaternion
from structlearn.primitives.position import fit_position
from structlearn.primitives.sequence import PosePrimitive
from structlearn.primitives.twist_swing import fit_twist_swing
from structlearn.primitives.vector import fit_vector

DT = 0.01


def learned(oriented=True):
    rng = np.random.default_rng(0)
    primitives = []
    reaches = {"approach": [0.0, 0.1, 0.9], "scrape along": [0.8, 0.1, 0.1], "stay": [0.0, 0.0, 0.001]}
    for name, goal in reaches.items():
        fit = fit_twist_swing if name == "scrape along" else fit_quaternion
        taught = wobbly_turn(rng, 1.0, dt=DT, base=random_orientations(rng))
        position = fit_position(
            [reach(rng, np.zeros(3), goal, dt=DT, detour=0.0)], scaled=(True, False, False)
        )
        primitives.append(PosePrimitive(name, position, fit([taught]) if oriented else None))
    return primitives


def expected_traces():
    rng = np.random.default_rng(1)
    return fit_vector([reach(rng, np.zeros(19), np.ones(19), dt=DT)], scaled=[True] * 10 + [False] * 9)


@pytest.mark.parametrize("oriented", [True, False])
def test_stored_primitives_unroll_bit_for_bit_as_before(tmp_path, oriented):
    primitives = learned(oriented)
    primitive_files.write_primitives(primitives, tmp_path / "p.safetensors")
    found = primitive_files.read_primitives(tmp_path / "p.safetensors")
    assert [primitive.name for primitive in found] == ["approach", "scrape along", "stay"]
    assert [primitive.position.frame for primitive in found] == ["side", "up", "world"]
    before, after = sequence.unroll(primitives, DT), sequence.unroll(found, DT)
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
    for name, values in vars(primitive.unroll(DT)).items():
        np.testing.assert_array_equal(getattr(found.unroll(DT), name), values)


CLAIM = {"pose_primitives": [{"name": "a", "frame": "up", "orientation": "quaternion"}]}
READERS = {
    "pose primitives": (
        primitive_files.read_primitives,
        lambda path: primitive_files.write_vector_primitive(expected_traces(), path, "traces"),
    ),
    "vector primitive": (
        primitive_files.read_vector_primitive,
        lambda path: primitive_files.write_primitives(learned(), path),
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
