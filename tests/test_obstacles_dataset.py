"""The people's reaches as samples: one person is recorded, the others are simulated where they are needed."""

import numpy as np
import pandas as pd
import pytest
from committed import committed
from obstacles_unrolls import baseline as fitted

from structlearn.avoidance.avoidance_dataset import (
    AvoidanceDataParameters,
    avoidance_dataset,
    baseline_axes,
    fit_baseline,
    from_table,
    samples,
    smooth_path,
    to_local,
    to_table,
)
from structlearn.core.artefacts import read_table, write_table
from structlearn.core.errors import InputError
from structlearn.core.params import Population
from structlearn.primitives.primitive_files import write_primitives
from structlearn.primitives.sequence import PosePrimitive
from structlearn.readers.demonstration import Demonstration, write_runs
from structlearn.testbeds.obstacles.files import BASELINE, read_baselines, write_baselines
from structlearn.testbeds.obstacles.protocol.avoidance_scores import taught
from structlearn.testbeds.obstacles.world.reaching_person import AvoiderParameters, captured, reaches
from structlearn.testbeds.obstacles.world.scenarios import SceneParameters, scenarios

SCENE = committed(SceneParameters, "obstacle_scene")
PERSON = committed(AvoiderParameters, "obstacle_demonstrator", count=3, baseline_count=8)
PARAMETERS = committed(AvoidanceDataParameters, "obstacle_dataset")


def demonstrations(scenario, scene=SCENE, person=PERSON):
    paths = reaches(scenario, scene, person)
    return [Demonstration(f"{number}", *path) for number, path in enumerate(paths)]


@pytest.fixture(scope="module")
def baseline():
    return fit_baseline(demonstrations(None), PARAMETERS)


@pytest.fixture(scope="module")
def sets():
    return [(scenario, demonstrations(scenario)) for scenario in (scenarios(SCENE)[3], scenarios(SCENE)[30])]


@pytest.fixture(scope="module")
def dataset(sets, baseline):
    return avoidance_dataset([(scenario.obstacle, its) for scenario, its in sets], baseline, PARAMETERS)


def test_smooth_path_has_the_derivatives_of_a_known_movement():
    time = np.arange(41) / 25
    position = np.outer(np.sin(np.pi * time), [1.0, 0.5, 0.0])
    sharp = committed(AvoidanceDataParameters, "obstacle_dataset", smoothing_hz=50)
    path = smooth_path(Demonstration("sine", time, position), sharp)
    inside = slice(10, -10)
    expected = -(np.pi**2) * np.outer(np.sin(np.pi * path.time), [1.0, 0.5, 0.0])
    np.testing.assert_allclose(path.acceleration[inside], expected[inside], atol=0.01 * np.pi**2)
    assert path.dt == pytest.approx(0.01)
    assert path.duration == pytest.approx(1.6)


def test_everything_is_in_the_frame_of_the_baseline(baseline, dataset, sets):
    np.testing.assert_allclose(to_local(baseline.start, baseline), 0.0, atol=1e-15)
    length = np.linalg.norm(baseline.goal - baseline.start)
    np.testing.assert_allclose(to_local(baseline.goal, baseline), [length, 0, 0], atol=1e-12)
    scenario, (first, *_) = sets[0]
    one = dataset.where((dataset.scenario == 0) & (dataset.demonstration == 0))
    centre = to_local(scenario.obstacle.centre, baseline)
    positions = (centre - one.features[:, :3]) @ baseline_axes(baseline).T + baseline.start
    np.testing.assert_allclose(positions[0], first.position[0], atol=5e-3)  # smoothed; cloud's mean
    np.testing.assert_allclose(positions[-1], first.position[-1], atol=0.02)  # thinned


def test_unrolled_with_its_target_the_baseline_is_the_demonstration(baseline, sets):
    scenario, (demonstration, *_) = sets[0]
    # the coupling is held over a step
    own = committed(AvoidanceDataParameters, "obstacle_dataset", rate_hz=1000, keep_every=1)
    path = smooth_path(demonstration, own).shifted(-baseline.start).turned(baseline_axes(baseline))
    one = samples(demonstration, scenario.obstacle.cloud(), baseline, own)
    ends, state = (path.position[0], path.position[-1]), (path.velocity[0], path.acceleration[0])
    coupling = {"coupling": lambda step, x, v: one.target[step]}
    unrolled = baseline.local.unroll(path.dt, *ends, path.duration, *state, **coupling)
    np.testing.assert_allclose(unrolled.position, path.position, atol=6e-4)
    assert np.abs(path.position[:, 2]).max() > 0.1  # where the baseline alone is not


def test_a_table_gives_the_dataset_back(dataset, tmp_path):
    write_table(to_table(dataset), tmp_path / "samples.parquet")
    read = from_table(read_table(tmp_path / "samples.parquet"))
    for name, values in vars(dataset).items():
        np.testing.assert_array_equal(getattr(read, name), values)
        assert getattr(read, name).dtype == values.dtype


def test_a_reach_along_gravity_has_a_frame_of_its_own():
    upright = {"start_m": (0, 0, 0), "goal_m": (0, 0, 0.7), "settings": 1}
    scene = committed(SceneParameters, "obstacle_scene", **upright)
    vertical = fit_baseline(demonstrations(None, scene), PARAMETERS)
    assert vertical.frame == "side"
    (scenario,) = scenarios(scene, ("cube",))
    found = avoidance_dataset([(scenario.obstacle, demonstrations(scenario, scene))], vertical, PARAMETERS)
    assert np.isfinite(found.features).all()
    assert found.features[0, 12] == pytest.approx(0.0, abs=0.3)
    assert found.features[:, 12].max() > 1.0  # x is along the reach


def test_bad_demonstrations_and_clouds_are_refused(baseline, sets):
    (scenario, (demonstration, *_)), _ = sets
    still = [Demonstration("still", np.arange(41) / 25, np.zeros((41, 3)))]
    with pytest.raises(InputError, match="the baseline's reach of 0 m is too short to have a direction"):
        fit_baseline(still, PARAMETERS)
    short = Demonstration("short", np.arange(4) / 25, np.zeros((4, 3)))
    with pytest.raises(InputError, match="short: 4 samples are too few for a reach"):
        samples(short, scenario.obstacle.cloud(), baseline, PARAMETERS)
    with pytest.raises(InputError, match="has no points"):
        samples(demonstration, np.empty((0, 3)), baseline, PARAMETERS)
    with pytest.raises(InputError, match="there are no demonstrations"):
        avoidance_dataset([], baseline, PARAMETERS)


def test_runs_teach_what_the_person_does(tmp_path):
    scene, person = (
        SCENE.model_copy(update={"settings": 1}),
        PERSON.model_copy(update={"count": 2, "seed": 3}),
    )
    for place in (None, *scenarios(scene)):
        name = BASELINE if place is None else place.name
        write_runs(captured(place, scene, person), tmp_path / f"{name}.parquet")
    read = taught(3, tmp_path, scene, person, PARAMETERS)
    nobody = person.model_copy(update={"seed": 99})  # whose runs these are not
    simulated, other = (taught(seed, tmp_path, scene, nobody, PARAMETERS) for seed in (3, 4))
    np.testing.assert_allclose(read[0].goal, simulated[0].goal, atol=1e-9)
    for ours, theirs in zip(read[1:], simulated[1:], strict=True):
        assert (ours["person"] == 3).all()
        pd.testing.assert_frame_equal(ours, theirs, rtol=1e-5, atol=1e-6)
    assert np.abs(other[0].goal - read[0].goal).max() > 1e-4


def test_everybody_s_baseline_comes_back(tmp_path):
    path = tmp_path / "baselines.safetensors"
    write_baselines({3: fitted(), 12: fitted((True, False, False))}, path)
    back = read_baselines(path)
    assert list(back) == [3, 12]
    np.testing.assert_array_equal(back[12].goal, fitted().goal)
    write_primitives([PosePrimitive("cut", fitted())], path)
    with pytest.raises(InputError, match="holds other primitives than baselines"):
        read_baselines(path)


def test_enough_people_are_judged_on_whom_nothing_was_chosen():
    population = committed(Population, "obstacle_people")
    assert len(population.test) >= 8
    assert set(range(1, 6)) <= set(population.tuning)  # looked at before
