"""The people of the obstacle testbed: one is recorded, the others are simulated where they are needed."""

import numpy as np
import pandas as pd
import pytest
from committed import committed
from obstacles_unrolls import baseline

from structlearn.avoidance.avoidance_dataset import AvoidanceDataParameters
from structlearn.core.errors import InputError
from structlearn.core.params import Population
from structlearn.primitives.primitive_files import write_primitives
from structlearn.primitives.sequence import PosePrimitive
from structlearn.readers.demonstration import write_runs
from structlearn.testbeds.obstacles.files import BASELINE, read_baselines, write_baselines
from structlearn.testbeds.obstacles.protocol.people import taught
from structlearn.testbeds.obstacles.world.reaching_person import AvoiderParameters, captured
from structlearn.testbeds.obstacles.world.scenarios import SceneParameters, scenarios

SCENE = committed(SceneParameters, "obstacle_scene", settings=1)
PERSON = committed(AvoiderParameters, "obstacle_demonstrator", seed=3, baseline_count=3, count=2)
PARAMETERS = committed(AvoidanceDataParameters, "obstacle_dataset")


def test_runs_teach_what_the_person_does(tmp_path):
    for place in (None, *scenarios(SCENE)):
        name = BASELINE if place is None else place.name
        write_runs(captured(place, SCENE, PERSON), tmp_path / f"{name}.parquet")
    read = taught(3, tmp_path, SCENE, PERSON, PARAMETERS)
    nobody = PERSON.model_copy(update={"seed": 99})  # whose runs these are not
    simulated, other = (taught(seed, tmp_path, SCENE, nobody, PARAMETERS) for seed in (3, 4))
    np.testing.assert_allclose(read[0].goal, simulated[0].goal, atol=1e-9)
    for ours, theirs in zip(read[1:], simulated[1:], strict=True):
        assert (ours["person"] == 3).all()
        pd.testing.assert_frame_equal(ours, theirs, rtol=1e-5, atol=1e-6)
    assert np.abs(other[0].goal - read[0].goal).max() > 1e-4


def test_everybody_s_baseline_comes_back(tmp_path):
    path = tmp_path / "baselines.safetensors"
    write_baselines({3: baseline(), 12: baseline((True, False, False))}, path)
    back = read_baselines(path)
    assert list(back) == [3, 12]
    np.testing.assert_array_equal(back[12].goal, baseline().goal)
    write_primitives([PosePrimitive("cut", baseline())], path)
    with pytest.raises(InputError, match="holds other primitives than baselines"):
        read_baselines(path)


def test_enough_people_are_judged_on_whom_nothing_was_chosen():
    population = committed(Population, "obstacle_people")
    assert len(population.test) >= 8
    assert set(range(1, 6)) <= set(population.tuning)  # looked at before
