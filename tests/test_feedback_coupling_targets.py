"""Corrected demonstrations made of known coupling terms and deviations give both back."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from committed import committed
from hypothesis import given
from hypothesis import strategies as st
from primitives_movements import few
from pydantic import ValidationError
from scraping_motions import minimum_jerk

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.core.frames import local_frame
from structlearn.feedback import coupling_targets
from structlearn.feedback.coupling import AXES, direction
from structlearn.primitives import canonical
from structlearn.primitives.orientation import fit_quaternion
from structlearn.primitives.position import fit_position
from structlearn.primitives.sequence import PosePrimitive
from structlearn.primitives.trajectory import OrientationTrajectory
from structlearn.primitives.twist_swing import fit_twist_swing
from structlearn.primitives.vector import expected_traces, fit_expected_traces
from structlearn.readers.demonstration import Demonstration

DT = 1 / 300
BEFORE, AFTER = 1.0, 1.0  # s of rest around the primitive
Y = direction("ry")
CHANNELS = 4


def parameters(**changes):
    own = {"primitives": ("turn",), "settings_deg": (5.0,)}
    return committed(coupling_targets.SupervisionParameters, "coupling_dataset", **own | changes)


PARAMETERS = parameters(smoothing_hz=20.0, target_hz=20.0)
FELT = PARAMETERS.sensors


def on_axes(*axes, **changes):
    """Parameters of corrections on any axes."""
    own = PARAMETERS.model_dump(include=set(coupling_targets.CorrectionParameters.model_fields))
    return coupling_targets.CorrectionParameters(**own | {"axes": axes} | changes)


def turn_path(duration):
    """A roll of 5 degrees that starts and ends at rest."""
    path = minimum_jerk([0.0, 0.0, 0.0], [0.0, np.radians(5.0), 0.0], duration)
    turned = quaternion.from_rotation_vector(path.position)
    return OrientationTrajectory(path.time, turned, path.velocity, path.acceleration)


@pytest.fixture(scope="module")
def primitive():
    point = fit_position([minimum_jerk([0, 0, 0], [0, 0.1, 0], 2.0)], (False, False, False))
    return PosePrimitive("turn", point, fit_quaternion([turn_path(2.0)]))


@pytest.fixture(scope="module")
def expected():
    waves = np.sin(np.linspace(0, 3, 401)[:, None] * [0.5, 1.0, 1.5, 2.0])
    return fit_expected_traces([30.0 * waves], 0.005, 6.0)


def known_coupling(time, duration, size=8.0):
    """Smooth, zero with its first derivatives at both ends, of two swings."""
    s = np.minimum(time / duration, 1.0)
    return size * 64 * s**3 * (1 - s) ** 3 * np.sin(2 * np.pi * s + 0.5)


def known_deviation(time):
    return np.round(10 * np.sin(time[:, None] * np.arange(1, CHANNELS + 1)))


def demonstration(primitive, expected, name="01", duration=2.4, axis=Y, size=8.0):
    """Rest, the primitive with a known coupling term; and where the primitive lies."""
    samples, before, after = (round(span / DT) for span in (duration, BEFORE, AFTER))
    time = DT * np.arange(samples + after + 1)  # it settles after its end
    coupling = known_coupling(time, duration, size)[:, None] * axis
    rest = {"velocity": 0.0, "acceleration": 0.0}
    path = primitive.orientation.unroll(
        DT, duration=duration, coupling=lambda k, q, w: coupling[k], until=time[-1], **rest
    )
    rows = np.maximum(np.arange(before + len(time)) - before, 0)
    tactile = np.zeros((len(rows), CHANNELS))
    felt = expected_traces(expected, samples + 1, DT) + known_deviation(time[: samples + 1])
    tactile[before : before + samples + 1] = felt
    run = Demonstration(
        name=name,
        time=DT * np.arange(len(rows)),
        position=np.zeros((len(rows), 3)),
        orientation=path.orientation[rows],
        tactile=tactile + np.array([100.0, -300.0, 0.0, 20.0]),
    )
    return run, pd.Series({"start_s": BEFORE, "end_s": BEFORE + duration})


@pytest.fixture(scope="module")
def supervised(primitive, expected):
    """Two demonstrations in one setting, one in another, of different durations."""
    made = {
        5.0: [demonstration(primitive, expected, name, span) for name, span in (("01", 2.0), ("02", 2.4))],
        10.0: [demonstration(primitive, expected, "01", 2.2, size=16.0)],
    }
    runs = {setting: [run for run, _ in rows] for setting, rows in made.items()}
    cuts = {
        setting: pd.DataFrame([cut for _, cut in rows], index=[run.name for run, _ in rows])
        for setting, rows in made.items()
    }
    datasets, _ = coupling_targets.coupling_dataset(runs, cuts, primitive, expected, PARAMETERS)
    assert list(datasets) == ["ry"]
    return runs, cuts, datasets["ry"]


def test_the_dataset_is_thinned_to_the_rate_of_the_sensors(supervised):
    dataset = supervised[2]
    for setting, number, duration in ((5.0, 0, 2.0), (5.0, 1, 2.4), (10.0, 0, 2.2)):
        rows = dataset.where((dataset.setting == setting) & (dataset.demonstration == number))
        np.testing.assert_allclose(rows.time, 0.01 * np.arange(round(100 * duration) + 1), atol=1e-9)
        p, u = canonical.phase(rows.time, canonical.time_constant(duration))
        np.testing.assert_allclose(rows.phase, p, atol=1e-9)
        np.testing.assert_allclose(rows.phase_velocity, u, atol=1e-9)
        exact = known_coupling(rows.time, duration, 8.0 * setting / 5.0)
        assert np.mean((rows.target - exact) ** 2) < 1e-3 * np.var(exact)
        np.testing.assert_allclose(rows.deviation, known_deviation(rows.time), atol=1e-9)
    assert len(dataset.target) == 201 + 241 + 221


@pytest.mark.parametrize("more", [0, 1, 2])
def test_the_phase_is_of_the_whole_duration_wherever_thinning_ends(primitive, expected, more):
    run, cut = demonstration(primitive, expected, duration=0.5 + more * DT)
    cuts = pd.DataFrame([cut], index=["01"])
    level = coupling_targets.level_dataset([run], cuts, expected, PARAMETERS)
    assert len(level.time) == 51
    p, u = canonical.phase(level.time, canonical.time_constant(0.5 + more * DT))
    np.testing.assert_allclose(level.phase, p, atol=1e-12)
    np.testing.assert_allclose(level.phase_velocity, u, atol=1e-12)


def test_on_the_level_board_nothing_is_to_be_corrected(supervised, primitive, expected):
    """Whatever the fingers feel there; an execution that could not be cut is left out."""
    runs, cuts, corrected = supervised
    level = coupling_targets.level_dataset(runs[5.0], cuts[5.0], expected, PARAMETERS)
    same = corrected.where(corrected.setting == 5.0)
    for name in ("deviation", "phase", "phase_velocity", "demonstration", "time"):
        np.testing.assert_array_equal(getattr(level, name), getattr(same, name))
    assert not level.target.any()
    assert not level.setting.any()
    one = coupling_targets.level_dataset(runs[5.0], cuts[5.0].iloc[1:], expected, PARAMETERS)
    np.testing.assert_array_equal(np.unique(one.demonstration), [1])


def test_a_correction_about_another_axis_shows_in_the_checks(primitive, expected):
    """At equal size about x as about y the rest is as large as what is kept."""
    run, cut = demonstration(primitive, expected, axis=np.array([1.0, 1.0, 0.0]))
    cuts = {5.0: pd.DataFrame([cut], index=["01"])}
    _, checks = coupling_targets.coupling_dataset({5.0: [run]}, cuts, primitive, expected, PARAMETERS)
    # over three axes, of which one is the axis itself
    assert checks["others"][0] == pytest.approx(np.sqrt(0.5), rel=0.05)
    assert checks["reproduction_deg"][0] > 0.5


def test_the_board_tilts_about_one_axis():
    for axes in (("y",), ("rx", "ry")):
        with pytest.raises(ValidationError, match="the board tilts about one axis"):
            parameters(axes=axes)
    with pytest.raises(ValidationError, match="holds one of them twice"):
        on_axes("z", "z")


def corrected_pose(primitive, expected, coupling, duration=2.2, start=None):
    """The whole pose from a start, with a coupling term (T, 6) as a function of time, and no rest."""
    time = DT * np.arange(round(duration / DT) + 1)
    c = coupling(time, time[-1])
    rest = {"velocity": 0.0, "acceleration": 0.0, "duration": time[-1]}
    start = primitive.position.start if start is None else start
    axes = local_frame(start, primitive.position.goal, primitive.position.frame)
    point = primitive.position.unroll(DT, start, coupling=lambda k, x, xd: c[k, :3] @ axes, **rest)
    turn = primitive.orientation.unroll(DT, coupling=lambda k, q, w: c[k, 3:], **rest)
    felt = expected_traces(expected, len(time), DT)
    run = Demonstration("01", time, point.position, turn.orientation, tactile=felt)
    return run, pd.Series({"start_s": 0.0, "end_s": time[-1]}), c


@given(chosen=st.sets(st.sampled_from(AXES), min_size=1, max_size=6), sign=st.sampled_from([-1.0, 1.0]))
@few
def test_known_coupling_terms_on_any_axes_come_back(primitive, expected, chosen, sign):
    """Of the position in m, of the orientation in rad; the axes that are not asked for are left alone."""
    axes = tuple(axis for axis in AXES if axis in chosen)
    sizes = sign * np.array([1.0, -0.5, 2.0, 4.0, 8.0, -4.0]) * np.isin(AXES, axes)

    def coupling(time, duration):
        return known_coupling(time, duration, 1.0)[:, None] * sizes

    run, cut, exact = corrected_pose(primitive, expected, coupling)
    own = on_axes(*axes, smoothing_hz=30.0, target_hz=30.0)
    datasets, checks = coupling_targets.coupling_dataset(
        {"left": [run]}, {"left": pd.DataFrame([cut], index=["01"])}, primitive, expected, own
    )
    assert tuple(datasets) == axes
    for axis, dataset in datasets.items():
        wanted = exact[::3, AXES.index(axis)]
        assert np.mean((dataset.target - wanted) ** 2) < 3e-3 * np.var(wanted)
        assert set(dataset.setting) == {"left"}
    assert list(checks["setting"]) == ["left"]
    for turning, error, others, limit in (
        (True, "reproduction_deg", "others", 0.1),
        (False, "reproduction_m", "others_position", 1e-4),
    ):
        assert (error in checks) == any(axis.startswith("r") is turning for axis in axes)
        if error in checks:
            assert checks[error][0] < limit
            assert checks[others][0] < 0.05


def test_a_demonstration_from_elsewhere_is_checked_in_the_frame_of_its_own_reach(primitive, expected):
    def coupling(time, duration):
        return known_coupling(time, duration, 1.0)[:, None] * [1.0, -0.5, 2.0, 0.0, 0.0, 0.0]

    start = primitive.position.start + np.array([0.08, 0.02, 0.0])
    run, cut, _ = corrected_pose(primitive, expected, coupling, start=start)
    cuts = {"left": pd.DataFrame([cut], index=["01"])}
    own = on_axes("x", "y", "z", smoothing_hz=30.0, target_hz=30.0)
    _, checks = coupling_targets.coupling_dataset({"left": [run]}, cuts, primitive, expected, own)
    assert checks["reproduction_m"][0] < 1e-4


@pytest.mark.parametrize(
    ("sensors", "groups", "counts"),
    [
        (("tactile",), (), [("tactile", 4)]),
        (("wrench",), (3, 3), [("wrench", 6)]),
        (("tactile", "wrench"), (4, 3, 3), [("tactile", 4), ("wrench", 6)]),
        (("wrench", "tactile"), (3, 3, 4), [("wrench", 6), ("tactile", 4)]),
    ],
)
def test_fingers_and_wrench_are_felt_alike(primitive, expected, sensors, groups, counts):
    """Side by side, each relative to its own first readings."""
    run, cut = demonstration(primitive, expected)
    rng = np.random.default_rng(0)
    run = replace(run, wrench=5.0 + rng.normal(size=(len(run.time), 6)).cumsum(axis=0) / 100.0)
    learned = coupling_targets.learn_expected(
        [run], {"turn": pd.DataFrame([cut], index=["01"])}, 5.0, sensors
    )
    assert list(coupling_targets.sensor_channels(sensors, learned)) == counts
    assert coupling_targets.channel_groups(run, sensors) == groups
    time, deviation = coupling_targets.executed_primitive(run, cut, learned["turn"], sensors)
    rows = slice(round(BEFORE / DT), round(BEFORE / DT) + len(time))
    raw = np.column_stack([getattr(run, sensor) for sensor in sensors])
    unrolled = expected_traces(learned["turn"], len(time), DT)
    np.testing.assert_allclose(deviation, raw[rows] - raw[:5].mean(axis=0) - unrolled, atol=1e-9)
    own = on_axes("ry", sensors=sensors)
    level = coupling_targets.level_dataset(
        [run], pd.DataFrame([cut], index=["01"]), learned["turn"], own, "nominal"
    )
    assert level.groups == groups
    assert set(level.setting) == {"nominal"}


def test_expected_traces_are_learned_per_primitive_and_without_offset():
    """Three runs of equal movements with offsets of their own: the traces are what they share."""
    time = DT * np.arange(round(4.0 / DT) + 1)
    wave = np.column_stack([20 * np.sin(time), 5 * time**2])
    rng = np.random.default_rng(0)
    runs = [
        Demonstration(f"{number}", time, np.zeros((len(time), 3)), tactile=wave + rng.normal(0, 100, 2))
        for number in range(3)
    ]
    segments, labels = {"first": (0.0, 1.6), "second": (1.6, 4.0)}, [run.name for run in runs]
    cuts = {
        name: pd.DataFrame([segment] * 3, columns=["start_s", "end_s"], index=labels)
        for name, segment in segments.items()
    }
    learned = coupling_targets.learn_expected(runs, cuts, 10.0, FELT)
    assert list(learned) == ["first", "second"]
    for name, (first, last) in segments.items():
        rows = slice(round(first / DT), round(last / DT) + 1)
        unrolled = expected_traces(learned[name], rows.stop - rows.start, DT)
        np.testing.assert_allclose(unrolled, wave[rows] - wave[:5].mean(axis=0), atol=0.7)


def test_cuts_a_little_outside_the_recording_end_at_its_ends(primitive, expected):
    """Fitted cut points can lie a sample before the first one."""
    run, _ = demonstration(primitive, expected)
    cut = pd.Series({"start_s": -0.004, "end_s": run.time[-1] + 0.01})
    time, deviation = coupling_targets.executed_primitive(run, cut, expected, FELT)
    assert len(time) == len(deviation) == len(run.time)


@pytest.mark.parametrize(
    ("change", "turn", "complaint"),
    [
        ({"tactile": None}, fit_quaternion, "07: has no tactile stream"),
        ({"tactile": np.zeros((1321, 3))}, fit_quaternion, "07: has 3 channels of tactile, the expected"),
        ({}, fit_twist_swing, "07: 'turn' needs orientations, and a turn of less than half"),
    ],
)
def test_what_is_missing_is_named(primitive, expected, change, turn, complaint):
    run, cut = demonstration(primitive, expected, "07")
    other = replace(primitive, orientation=turn([turn_path(2.0)]))
    with pytest.raises(InputError, match=complaint):
        coupling_targets.corrected_primitive(replace(run, **change), cut, other, expected, PARAMETERS)


def test_primitives_that_cannot_get_feedback_are_named(primitive, expected):
    run, _ = demonstration(primitive, expected)
    none = pd.DataFrame(columns=["start_s", "end_s"])
    with pytest.raises(InputError, match="'turn' was cut in none of the corrected demonstrations"):
        coupling_targets.coupling_dataset({5.0: [run]}, {5.0: none}, primitive, expected, PARAMETERS)
    with pytest.raises(InputError, match="there is no primitive 'tern' among turn"):
        coupling_targets.require_parts(["tern"], [primitive], {"turn": expected})
    with pytest.raises(InputError, match="no expected traces of 'turn'"):
        coupling_targets.require_parts(["turn"], [primitive], {})
