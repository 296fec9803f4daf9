import numpy as np
import pandas as pd
import pytest
from committed import committed
from feedback_skills import random_network
from hypothesis import given
from hypothesis import strategies as st

from dissertation.scraping.protocol import execution_scores
from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.feedback.coupling_targets import SupervisionParameters, executed_primitive
from structlearn.primitives import canonical
from structlearn.primitives.vector import fit_expected_traces
from structlearn.readers.demonstration import Demonstration

RATE_HZ = 100.0
SEGMENTS = np.array([[0.0, 0.5], [0.5, 2.5], [2.5, 5.0]])
NAMES = ("down", "turn", "scrape")
Y = np.array([0.0, 1.0, 0.0])


def execution(name="01", roll=0.0, seed=0, axis=Y, segments=SEGMENTS, **changes):
    """Three primitives, six tactile channels, a tool with a roll (scalar or (T,)) in rad to the board."""
    time = np.arange(round(SEGMENTS[-1, 1] * RATE_HZ) + 11) / RATE_HZ
    rng = np.random.default_rng(seed)
    turns = quaternion.from_rotation_vector(np.broadcast_to(roll, len(time))[:, None] * axis)
    signals = {
        "position": np.zeros((len(time), 3)),
        "orientation": turns,
        "tool_to_board": turns,
        "tactile": np.rint(rng.normal(0.0, 10.0, (len(time), 6))),
        "wrench": np.tile([0.0, 0.0, -1.0, 0.0, -2e-3, 0.0], (len(time), 1)),
        "true_segments": segments,
    }
    return Demonstration(name=name, time=time, **(signals | changes))


SCORED = ("turn", "scrape")
NOMINAL = execution_scores.nominal_orientation([execution()])
PARAMETERS = committed(
    SupervisionParameters, "coupling_dataset", primitives=SCORED, settings_deg=(5.0,), rate_hz=50.0
)


def scores(*runs):
    labels = [run.name for run in runs]
    cuts = {
        name: pd.DataFrame([SEGMENTS[NAMES.index(name)]] * len(runs), labels, ["start_s", "end_s"])
        for name in SCORED
    }
    return execution_scores.execution_scores(runs, cuts, NOMINAL, Y)


def test_scores_of_a_model_are_those_of_its_runs_by_setting_and_primitive():
    runs = {setting: [execution(f"{n}", roll=setting / 100.0 * n) for n in (1, 2)] for setting in (5.0, 10.0)}
    table = execution_scores.scores("ours", runs, NAMES, NOMINAL, PARAMETERS)
    assert len(table.drop_duplicates(["setting_deg", "run", "primitive"])) == len(table) == 2**3
    assert (table["model"] == "ours").all()
    alone = scores(*runs[10.0])  # the first primitive has no feedback
    part = table.loc[table["setting_deg"] == 10.0, alone.columns]
    pd.testing.assert_frame_equal(part.reset_index(drop=True), alone)


def test_a_steady_roll_gives_closed_form_scores():
    table = scores(execution("01", roll=-0.1), execution("02", roll=0.02))
    assert table["run"].tolist() == ["01", "01", "02", "02"]
    assert table["primitive"].tolist() == ["turn", "scrape"] * 2
    samples = np.round(np.diff(SEGMENTS[1:])[:, 0] * RATE_HZ) + 1
    np.testing.assert_allclose(table["cost_rad"], np.ravel(np.outer([0.1, 0.02], samples)))
    np.testing.assert_allclose(table["mean_deg"], np.degrees([0.1, 0.1, 0.02, 0.02]))
    np.testing.assert_allclose(table["end_roll_deg"], np.degrees([-0.1, -0.1, 0.02, 0.02]))
    np.testing.assert_allclose(table["force_n"], 1.0)
    np.testing.assert_allclose(table["force_std_n"], 0.0, atol=1e-12)
    np.testing.assert_allclose(table["roll_torque_mn_m"], 2.0)


def test_the_final_roll_is_of_the_last_fifth_of_a_second_and_force_of_settled_contact():
    time = execution().time
    roll = np.where(time < SEGMENTS[1, 1] - 0.205, 0.3, 0.1)
    run = execution(roll=roll)
    impact = run.time < SEGMENTS[1, 0] + execution_scores.SETTLED_S - 0.005
    run.wrench[impact, 2] = -9.0
    run.wrench[impact, 4] = 1.0
    turn = scores(run).set_index("primitive").loc["turn"]
    assert turn["end_roll_deg"] == pytest.approx(np.degrees(0.1))
    assert turn["mean_deg"] > np.degrees(0.25)
    assert turn["force_n"] == pytest.approx(1.0)
    assert turn["roll_torque_mn_m"] == pytest.approx(2.0)


def test_force_and_torque_are_missing_where_no_wrench_was_recorded():
    table = scores(execution("01", wrench=None), execution("02"))
    assert table.loc[table["run"] == "01", "force_n"].isna().all()
    assert table.loc[table["run"] == "02", "force_n"].notna().all()
    assert table["cost_rad"].notna().all()
    assert "force_n" not in scores(execution(wrench=None))


@pytest.fixture(scope="module")
def expected():
    waves = 10 * np.sin(np.linspace(0, 3, 201)[:, None] * np.arange(1, 7))
    return fit_expected_traces([waves], 0.01, 6.0)


def test_traces_hold_what_the_model_made_of_the_deviations(expected):
    network = random_network(np.random.default_rng(0))
    runs = {5.0: [execution("01", seed=1), execution("02", seed=2)], 10.0: [execution("01", seed=3)]}
    cut = pd.Series(SEGMENTS[1], ["start_s", "end_s"])
    own = PARAMETERS.model_copy(update={"primitives": ("turn",)})
    table = execution_scores.traces("ours", runs, NAMES, {"turn": network}, {"turn": expected}, own)
    table = table.drop(columns=["model", "primitive"])
    channels = [f"channel_{index:02d}" for index in range(6)]
    assert list(table.columns) == ["setting_deg", "run", "time_s", "coupling", *channels]
    for (setting, name), rows in table.groupby(["setting_deg", "run"]):
        run = next(run for run in runs[setting] if run.name == name)
        _, deviation = executed_primitive(run, cut, expected, PARAMETERS.sensors)
        np.testing.assert_allclose(rows["time_s"], 0.02 * np.arange(101), atol=1e-9)
        np.testing.assert_allclose(rows[channels], deviation[::2])
        p, u = canonical.phase(rows["time_s"].to_numpy(), canonical.time_constant(2.0))
        exact = network.coupling(deviation[::2], p, u)
        np.testing.assert_allclose(rows["coupling"], exact)
    assert len(table) == 3 * 101


angles = st.floats(-1.5, 1.5)


@pytest.mark.parametrize("axis", [Y, np.array([0.6, 0.0, 0.8])])
@given(nominal=angles, roll=angles)
def test_the_cost_of_a_turn_about_one_axis_is_its_angle(axis, nominal, roll):
    """J = | 2 log(Q_nr o Q_cr*) | (eq. IV.34)."""
    mean = execution_scores.nominal_orientation([execution(roll=nominal, axis=axis)])
    cost = execution_scores.orientation_cost(execution(roll=roll, axis=axis), mean)
    np.testing.assert_allclose(cost, abs(roll - nominal), atol=1e-9)


def test_the_nominal_orientation_is_the_mean_over_runs():
    rolls = [0.01, 0.03, -0.01]
    nominal = execution_scores.nominal_orientation([execution(roll=roll) for roll in rolls])
    np.testing.assert_allclose(quaternion.rotation_vector(nominal)[:, 1], np.mean(rolls), atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(nominal, axis=1), 1.0)
    run = execution(roll=0.1)  # of two lengths the shorter one is compared
    assert len(execution_scores.orientation_cost(run, nominal[:200])) == 200
    assert len(execution_scores.orientation_cost(run, np.concatenate([nominal, nominal]))) == len(run.time)


def test_signs_of_quaternions_do_not_matter():
    """Also where single runs, or single samples, have the other sign."""
    path = np.linspace(0.0, 0.4, 511)
    plain = [execution(roll=path), execution(roll=path + 0.02)]
    flipped = [plain[0], execution(roll=path + 0.02, tool_to_board=-plain[1].tool_to_board)]
    signs = np.where(np.arange(511) % 2, 1.0, -1.0)[:, None]
    alternating = execution(roll=path, tool_to_board=signs * plain[0].tool_to_board)
    nominal = execution_scores.nominal_orientation(plain)
    assert quaternion.angle_between(execution_scores.nominal_orientation(flipped), nominal).max() < 1e-9
    np.testing.assert_allclose(
        execution_scores.orientation_cost(alternating, nominal),
        execution_scores.orientation_cost(plain[0], nominal),
    )


def test_a_run_without_motion_capture_is_named():
    blind = execution("07", tool_to_board=None)
    with pytest.raises(InputError, match="07: has no tool-to-board orientation"):
        execution_scores.nominal_orientation([execution(), blind])
    with pytest.raises(InputError, match="07: has no tool-to-board orientation"):
        execution_scores.orientation_cost(blind, execution_scores.nominal_orientation([execution()]))
