"""The protocols on public recordings: bounds that must hold, where the recordings are at hand."""

from pathlib import Path

import numpy as np
import pytest

from structlearn.ground import quaternion
from structlearn.ground.params import read_parameters
from structlearn.primitives.fitting import FitParameters, segment_paths, whole
from structlearn.recordings import clmc, slide, synchronise
from structlearn.segmentation.cut_errors import mean_cut_errors_ms
from structlearn.testbeds.recorded.protocol import human_reaches, scraping_execution, slides, unscrewing


@pytest.fixture(scope="module")
def parameter_file(root) -> Path:
    return root / "params.yaml"


@pytest.fixture(scope="module")
def reach_demonstrations(recorded_data):
    return [synchronise(recording) for recording in clmc.read_reaches(recorded_data / "clmc")]


def test_reaches_are_found_between_rests(reach_demonstrations, parameter_file):
    parameters = read_parameters(parameter_file, "recorded_reaches", human_reaches.ReachParameters)
    few = parameters.model_copy(update={"noise_mm": (0.5, 2.0), "seeds": 1})
    errors = human_reaches.reach_cut_errors(reach_demonstrations, few)
    mean = {level: mean_cut_errors_ms(part)["mean_ms"]["wls"] for level, part in errors.groupby("noise_mm")}
    assert mean[0.5] < 25.0
    assert mean[2.0] <= 40.0


def test_one_primitive_serves_all_reaches(reach_demonstrations, parameter_file):
    parameters = read_parameters(parameter_file, "recorded_reaches", human_reaches.ReachParameters)
    _, errors = human_reaches.learn_reaches(reach_demonstrations, parameters)
    learned = errors[errors["variant"] == "learned from"]
    assert len(learned) == 97
    assert learned["mean_mm"].mean() <= 16.7
    assert learned["end_mm"].max() <= 0.4
    assert set(errors["variant"].value_counts()) == {97}  # also left out, and without scaling
    segments = segment_paths(reach_demonstrations, whole(reach_demonstrations), parameters.fit.smoothing_hz)
    assert abs(human_reaches.own_spread_mm(segments) - 17.3) < 0.2


def test_unscrewing_turns_nearly_all_the_way_round(recorded_data, parameter_file):
    parameters = read_parameters(parameter_file, "recorded_unscrewing", FitParameters)
    logs = [synchronise(recording) for recording in clmc.read_unscrewing(recorded_data / "clmc")]
    _, errors = unscrewing.learn_unscrewing(logs, parameters)
    single, joint = errors[errors["learned_from"] != "all"], errors[errors["learned_from"] == "all"]
    assert (single["turn_deg"] > 340.0).all()
    assert single["mean_deg"].mean() <= 2.5
    assert joint["mean_deg"].item() <= 1.5
    assert errors["end_deg"].max() <= 0.5


def test_scraping_execution_is_reproduced_as_a_sequence(recorded_data, parameter_file):
    parameters = read_parameters(parameter_file, "recorded_scraping", scraping_execution.ExecutionParameters)
    parts = [synchronise(recording) for recording in clmc.read_scraping_execution(recorded_data / "clmc")]
    _, path, errors = scraping_execution.learn_execution(parts, parameters.fit)
    assert errors["mean_mm"].max() < 1.0
    assert errors["mean_deg"].max() < 1.0
    for signal in (path.position.acceleration, path.orientation.angular_acceleration):
        jumps = np.abs(np.diff(signal, axis=0))[path.switches[1:-1] - 1]
        assert jumps.max() < 0.05 * np.abs(signal).max()
    _, scores, _ = scraping_execution.learn_traces(parts, parameters)
    assert len(scores) == 3 * 38
    assert scores[scores["range"] > 20]["nmse"].mean() < 0.1


def test_slides_deviate_more_on_another_material(recorded_data, parameter_file):
    parameters = read_parameters(parameter_file, "recorded_slides", slides.SlideParameters)
    recordings = slide.read_slides(recorded_data / "slide")
    demonstrations = [
        synchronise(recording, parameters.rate_hz, parameters.max_gap_s) for recording in recordings
    ]
    _, deviations, statistics = slides.learn_slides(demonstrations, parameters)
    by_group = deviations.groupby("group")["rms"]
    assert by_group.count().to_dict() == {"learned": 10, "left out": 2, "other material": 12}
    assert by_group.mean()["other material"] > by_group.mean()["learned"]
    assert set(statistics["electrode"]) == set(range(1, 20))
    clock = slides.clock_errors(recordings).set_index("kind")
    assert clock.loc["pose", "rms_error"] < 2e-4  # m, with every second sample held out


def test_mean_orientation_path_is_the_middle_of_two():
    axis = np.array([0.0, 0.0, 1.0])
    angles = np.linspace(0.0, 3.0, 50)[:, None]
    paths = [quaternion.from_rotation_vector(factor * angles * axis) for factor in (0.8, 1.2)]
    mean = unscrewing.mean_orientation_path(paths, 70)
    expected = quaternion.from_rotation_vector(np.linspace(0.0, 3.0, 70)[:, None] * axis)
    assert quaternion.angle_between(mean, expected).max() < 1e-3
