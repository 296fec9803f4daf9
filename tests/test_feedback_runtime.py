import copy
import pickle
import subprocess
import sys
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from feedback_skills import NAMES, POINTS, random_network, random_skill
from primitives_movements import for_few_rngs, random_orientations, random_vectors

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.feedback.coupling import AXES, direction
from structlearn.feedback.models.pmnn import open_loop
from structlearn.feedback.runtime import Controller, Status
from structlearn.feedback.skill import (
    Limits,
    ReactiveSkill,
    Workspace,
    demonstrated_limits,
    largest_coupling,
    on_axis,
)
from structlearn.primitives import canonical, kernels, sequence
from structlearn.primitives.orientation import QuaternionPrimitive
from structlearn.primitives.position import PositionPrimitive
from structlearn.primitives.sequence import PoseGoal, PosePrimitive
from structlearn.primitives.transformation import ALPHA, ALPHA_G, BETA
from structlearn.primitives.vector import OFFSET_SAMPLES, VectorPrimitive

POSITION = ("position", "velocity", "acceleration")
ORIENTATION = ("orientation", "angular_velocity", "angular_acceleration")
UNBOUNDED = Limits(largest_coupling=dict.fromkeys(AXES, 1e4), fade_s=1e-3, stale_after_s=60.0)
AXIS = "ry"
BASE = np.array([300.0, 310.0, 290.0, 305.0, 280.0, 320.0])
RATE = 300.0


def started(controller):
    start = sequence.default_start(controller.skill.primitives)
    controller.start(start.position, start.orientation)
    return controller


def run(controller, sensor=lambda k: None, ticks=None):
    """Outputs of a whole run, stacked, and the flags; `sensor` gives what each tick is handed."""
    names = (*POSITION, *ORIENTATION, "deviation", "coupling", "primitive", "time", "phase", "finished")
    outputs, flags = {name: [] for name in names}, []
    while not controller.finished if ticks is None else len(flags) < ticks:
        flags.append(Status(controller.tick(sensor(len(flags)))))
        for name in names:
            outputs[name].append(np.copy(getattr(controller, name)))
    return {name: np.array(values) for name, values in outputs.items()}, flags


def with_feedback(rng, size=20.0, name="tilt", **arguments):
    return random_skill(rng, on_axis({name: random_network(rng, size=size, **arguments)}, AXIS))


def bounded(skill, limits=UNBOUNDED):
    return replace(skill, limits=limits)


def assert_motions_agree(found, expected, tolerance=1e-9):
    """Position, orientation and their derivatives, relative to the largest of each."""
    for name in (*POSITION, *ORIENTATION):
        atol = tolerance * np.abs(expected[name]).max()
        np.testing.assert_allclose(found[name], expected[name], rtol=tolerance, atol=atol)


def touching(rng, noise=30.0):
    """A sensor at 100 Hz, read by a controller at 300 Hz."""
    samples = BASE + noise * rng.normal(size=(10_000, 6))
    samples[:10] = BASE
    return lambda k: samples[k // 3] if k % 3 == 0 else None


@pytest.mark.parametrize(("rate", "moved"), [(100.0, False), (300.0, True), (1000.0, True)])
@for_few_rngs
def test_without_feedback_the_ticks_are_the_unrolled_sequence(rate, moved, rng):
    skill = with_feedback(rng)
    start, situation = sequence.default_start(skill.primitives), {}
    if moved:
        start = PoseGoal(start.position + random_vectors(rng, 0.05), random_orientations(rng))
        turn = quaternion.from_rotation_vector(random_vectors(rng, 0.3))
        goals = sequence.moved_goals(
            sequence.default_goals(skill.primitives), rng.uniform(-0.1, 0.1, 3), turn
        )
        situation = {"goals": goals, "durations": rng.uniform(0.3, 0.9, 3)}
    path = sequence.unroll(skill.primitives, 1 / rate, start, **situation)
    controller = Controller(skill, rate, feedback=False, **situation)
    controller.start(start.position, start.orientation)
    np.testing.assert_allclose(controller.position, start.position, atol=1e-15)  # as after the first tick
    np.testing.assert_allclose(controller.orientation, start.orientation, atol=1e-15)
    assert (controller.time, controller.phase, controller.primitive) == (0.0, 1.0, 0)
    outputs, _ = run(controller)
    assert len(outputs["time"]) == path.switches[-1] + 1
    assert_motions_agree(outputs, vars(path.position) | vars(path.orientation))
    np.testing.assert_allclose(outputs["time"], path.position.time, atol=1e-9)
    table = sequence.sequence_table(path, NAMES)
    assert [NAMES[index] for index in outputs["primitive"]] == list(table.primitive)
    assert list(outputs["finished"]) == [False] * path.switches[-1] + [True]
    for index, duration in enumerate(situation.get("durations", [p.duration for p in skill.primitives])):
        first, last = path.switches[index], path.switches[index + 1]
        times = np.arange(last - first) / rate
        expected, _ = canonical.phase(times, canonical.time_constant(duration))
        np.testing.assert_allclose(outputs["phase"][first:last], expected, atol=1e-12)


@pytest.mark.parametrize(("sensor_every", "axis"), [(1, "rx"), (3, "ry"), (1, "rz")])
@for_few_rngs
def test_with_feedback_the_ticks_are_the_unrolled_primitive_with_its_coupling(sensor_every, axis, rng):
    network = random_network(rng, size=20.0)
    skill = random_skill(rng, on_axis({"tilt": network}, axis), limits=UNBOUNDED)
    down, tilt, _ = skill.primitives
    gain = rng.normal(0.0, 100.0, (3, 6))

    def reading(q):  # the sensor feels the orientation: the loop is closed
        return BASE + quaternion.rotation_vector(q) @ gain

    controller, newest, outputs, flags = started(Controller(skill, RATE)), [], [], []
    while controller.primitive < 2:
        counts = None if len(outputs) % sensor_every else reading(controller.orientation)
        newest.append(newest[-1] if counts is None else counts)
        flags.append(Status(controller.tick(counts)))
        outputs.append([np.copy(getattr(controller, name)) for name in ORIENTATION])
    outputs = [np.array(values) for values in zip(*outputs, strict=True)]
    assert not any(flags[(OFFSET_SAMPLES - 1) * sensor_every :])

    dt, zero = 1 / RATE, np.mean(newest[: OFFSET_SAMPLES * sensor_every : sensor_every], axis=0)
    switch = round(down.duration * RATE)
    expected = skill.expected["tilt"].unroll(dt, duration=tilt.duration).position
    p, u = canonical.phase(dt * np.arange(len(expected)), canonical.time_constant(tilt.duration))

    def coupling(k, q, w):
        return direction(axis) * network.coupling(newest[switch + k] - zero - expected[k], p[k], u[k])

    begin = down.orientation.unroll(dt, velocity=0.0, acceleration=0.0)
    state = {"velocity": begin.angular_velocity[-1], "acceleration": begin.angular_acceleration[-1]}
    path = tilt.orientation.unroll(dt, begin.orientation[-1], coupling=coupling, **state)
    straight = tilt.orientation.unroll(dt, begin.orientation[-1], **state)
    bent = quaternion.angle_between(path.orientation, straight.orientation)
    assert bent.max() > np.radians(0.5)  # else this would check nothing
    for found, name in zip(outputs, ORIENTATION, strict=True):
        expected_values = getattr(path, name)[:-1]
        found = found[switch : switch + len(expected_values)]
        scale = np.abs(expected_values).max()
        np.testing.assert_allclose(found, expected_values, atol=1e-9 * scale)


def still_primitive(duration):
    """A pose that stays: without feedback nothing moves."""
    zeros = np.zeros(3)
    local = VectorPrimitive(np.zeros((25, 3)), zeros, zeros, zeros, zeros, duration, np.zeros(3, dtype=bool))
    unit = quaternion.IDENTITY
    turn = QuaternionPrimitive(np.zeros((25, 3)), unit, unit, zeros, zeros, duration)
    return PosePrimitive("down", PositionPrimitive(local, "world", zeros, zeros), turn)


@pytest.mark.parametrize("axis", AXES)
@for_few_rngs
def test_a_coupling_term_on_one_axis_acts_as_a_sum_of_steps_does(axis, rng):
    """Closed form of the critically damped system, which the other axes do not feel.

    Positions add up (eq. IV.1 is linear), so the primitive moves; about a rotation axis it is still.
    """
    policy = {"down": {axis: open_loop(rng.normal(0.0, 2.0, 25))}}
    moving = random_skill(rng)
    primitive = still_primitive(rng.uniform(0.4, 0.8)) if axis.startswith("r") else moving.primitives[0]
    skill = ReactiveSkill([primitive], {}, policy, UNBOUNDED)
    outputs, free = (run(started(Controller(skill, RATE, feedback=acts)))[0] for acts in (True, False))
    tau, times = canonical.time_constant(primitive.duration), outputs["time"]
    frequency, c = 0.5 * ALPHA / tau, outputs["coupling"][:, 0]
    passed = frequency * np.maximum(times[:, None] - times, 0.0)  # (T, T) since each change
    step = (1.0 - (1.0 + passed) * np.exp(-passed)) / (ALPHA * BETA)
    moved = np.zeros((len(times), 6))
    moved[:, AXES.index(axis)] = step @ np.diff(c, prepend=0.0)
    assert np.ptp(moved) > 0.003
    np.testing.assert_allclose(outputs["position"] - free["position"], moved[:, :3], atol=1e-9)
    turned = quaternion.difference(outputs["orientation"], free["orientation"])
    np.testing.assert_allclose(turned, moved[:, 3:], atol=1e-9)
    features = kernels.features(*canonical.phase(times, tau))
    np.testing.assert_allclose(c, features @ policy["down"][axis].phase_biases, atol=1e-9)


def test_a_corrected_end_is_where_the_next_primitive_starts():
    """Position, velocity and acceleration go on smoothly over the switch, and the goal is reached."""
    rng = np.random.default_rng(20)
    shift = {"z": open_loop(np.full(25, -1.5))}
    skill = random_skill(rng, {"down": shift}, limits=UNBOUNDED)
    outputs, _ = run(started(Controller(skill, 1000.0)), ticks=3500)
    still, _ = run(started(Controller(skill, 1000.0, feedback=False)), ticks=3500)
    switch = np.flatnonzero(np.diff(outputs["primitive"]))[0] + 1
    assert abs(outputs["position"][switch, 2] - still["position"][switch, 2]) > 1e-4
    for name in POSITION:
        ours, theirs = (np.abs(np.diff(one[name], axis=0)) for one in (outputs, still))
        assert ours[switch - 2 : switch + 2].max() <= 2.0 * theirs.max()
    np.testing.assert_allclose(outputs["position"][-1], skill.primitives[-1].position.goal, atol=1e-6)


def test_a_second_run_repeats_the_first_whatever_happened_in_it():
    rng = np.random.default_rng(1)
    skill, sensor = with_feedback(rng), touching(rng)
    controller = Controller(skill, RATE)
    first, flags = run(started(controller), sensor)
    started(controller).move_goal("tilt", POINTS[2] + 0.05, random_orientations(rng))
    run(controller, lambda k: np.full(6, np.nan) if k % 2 else None, ticks=200)
    second, again = run(started(controller), sensor)
    assert flags == again
    for name, values in first.items():
        np.testing.assert_array_equal(values, second[name])


def in_use(rng):
    """A controller within `tilt`, with feedback and a moved goal, and its sensor."""
    controller, sensor = started(Controller(with_feedback(rng), RATE)), touching(rng)
    run(controller, sensor, ticks=round(RATE * controller.skill.primitives[0].duration) + 60)
    controller.move_goal("scrape", POINTS[3] - 0.05, random_orientations(rng))
    return controller, sensor


@pytest.mark.parametrize(
    "copied",
    [copy.copy, copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))],
    ids=["copy", "deepcopy", "pickle"],
)
def test_a_copy_continues_the_run_on_its_own(copied):
    controller, sensor = in_use(np.random.default_rng(30))
    before = [np.copy(getattr(controller, name)) for name in POSITION]
    other = copied(controller)
    assert not other.position.flags.writeable
    for _ in range(2):  # the rest of this run, and another one
        found, flags = run(other, sensor)
        for name, values in zip(POSITION, before, strict=True):
            np.testing.assert_array_equal(getattr(controller, name), values)
        expected, as_before = run(controller, sensor)
        assert flags == as_before
        assert np.abs(expected["coupling"]).max() > 1.0
        for name, values in expected.items():
            np.testing.assert_array_equal(found[name], values, name)
        before = [np.copy(getattr(started(controller), name)) for name in POSITION]
        started(other)


def test_a_copy_before_the_start_has_not_started():
    other = copy.copy(Controller(with_feedback(np.random.default_rng(30)), RATE))
    with pytest.raises(RuntimeError, match=r"start\(\) comes before"):
        other.tick(None)


def test_a_pickled_controller_continues_in_another_process(tmp_path):
    """Compiled functions have other addresses there."""
    controller, _ = in_use(np.random.default_rng(31))
    (tmp_path / "controller").write_bytes(pickle.dumps(controller))
    ticks = (
        "import pickle, sys; import numpy as np\n"
        "controller = pickle.loads(open(sys.argv[1], 'rb').read())\n"
        "for _ in range(40): controller.tick(np.arange(300.0, 306.0))\n"
        "np.save(sys.argv[2], np.concatenate([controller.orientation, controller.coupling]))"
    )
    command = [sys.executable, "-c", ticks, str(tmp_path / "controller"), str(tmp_path / "found.npy")]
    subprocess.run(command, check=True)
    for _ in range(40):
        controller.tick(np.arange(300.0, 306.0))
    assert abs(controller.coupling[0]) > 0.1
    np.testing.assert_array_equal(
        np.load(tmp_path / "found.npy"), np.concatenate([controller.orientation, controller.coupling])
    )


def test_positions_without_orientations_can_be_followed():
    skill = random_skill(np.random.default_rng(2), turned=False)
    controller = Controller(skill, RATE)
    controller.start(skill.primitives[0].position.start)
    outputs, _ = run(controller)
    path = sequence.unroll(skill.primitives, 1 / RATE)
    np.testing.assert_allclose(outputs["position"], path.position.position, atol=1e-9)
    np.testing.assert_array_equal(
        outputs["orientation"], np.tile(quaternion.IDENTITY, (len(path.position.time), 1))
    )


BOUNDS = Limits(largest_coupling={AXIS: 40.0}, fade_s=0.1, stale_after_s=0.05)


def steady_skill(rng):
    """`tilt` has a network whose coupling is 2 u, whatever a working sensor reads."""
    blind = {"phase_weights": np.zeros((25, 6)), "phase_biases": np.full(25, 2.0)}
    network = replace(random_network(rng, hidden=()), output_weights=np.ones(25), **blind)
    return random_skill(rng, on_axis({"tilt": network}, AXIS), limits=BOUNDS)


@pytest.mark.parametrize(("channel", "value"), [(slice(None), np.nan), (2, np.inf), (5, -np.inf)])
def test_a_sample_that_is_not_finite_is_rejected_and_the_last_good_one_held(channel, value):
    rng = np.random.default_rng(3)
    skill, sensor, bad = with_feedback(rng), touching(rng), BASE.copy()
    bad[channel] = value
    outputs, flags = run(started(Controller(skill, RATE)), lambda k: bad if k == 240 else sensor(k))
    held, _ = run(started(Controller(skill, RATE)), lambda k: None if k == 240 else sensor(k))
    assert [k for k, flag in enumerate(flags) if flag & Status.REJECTED] == [240]
    for name in ("orientation", "deviation", "coupling"):
        np.testing.assert_array_equal(outputs[name], held[name])


@pytest.mark.parametrize("fault", ["silent", "missing finger"])
def test_without_good_samples_the_coupling_fades_and_comes_back_smoothly(fault):
    skill = steady_skill(np.random.default_rng(4))
    rate, first, last = 1000.0, 0.12, 0.30
    begin = round(skill.primitives[0].duration * rate)
    half = BASE.copy()
    half[:3] = np.nan
    lost = half if fault == "missing finger" else None
    silence = range(begin + round(first * rate), begin + round(last * rate))
    outputs, flags = run(started(Controller(skill, rate)), lambda k: lost if k in silence else BASE)
    free, _ = run(started(Controller(skill, rate)), lambda k: BASE)
    c, wanted = outputs["coupling"][:, 0], free["coupling"][:, 0]
    stale = [k for k, flag in enumerate(flags) if flag & Status.STALE]
    assert stale == list(silence[50:])  # 50 ms after the last good one, until the next
    np.testing.assert_array_equal(c[: stale[0]], wanted[: stale[0]])  # held as if nothing had happened
    assert abs(wanted[stale[0]]) > 4.0
    np.testing.assert_allclose(c[stale[0] + 60 : stale[-1]], 0.0, atol=1e-12)  # 40 in 0.1 s
    np.testing.assert_array_equal(c[stale[-1] + 61 :], wanted[stale[-1] + 61 :])
    within = np.diff(outputs["primitive"]) == 0  # at a switch the goal absorbs what the predecessor's was
    assert np.abs(np.diff(c)[within]).max() <= 0.4 + 1e-9  # 40 / 0.1 s at 1 kHz
    rejected = [k for k, flag in enumerate(flags) if flag & Status.REJECTED]
    assert rejected == ([] if fault == "silent" else list(silence))


@pytest.mark.parametrize("kind", [float, np.float32, int, np.uint16])
def test_a_sample_with_a_masked_channel_is_rejected_as_one_with_nan(kind):
    skill, counts = with_feedback(np.random.default_rng(3)), np.round(BASE).astype(kind)
    masked, missing = (
        np.ma.MaskedArray(counts, mask=np.arange(6) == 2),
        np.where(np.arange(6) == 2, np.nan, BASE),
    )
    sensors = [lambda k, odd=odd: odd if k > 150 else counts for odd in (masked, missing)]
    (found, flags), (expected, same) = (run(started(Controller(skill, RATE)), one) for one in sensors)
    assert flags == same
    assert Status.REJECTED in flags[200]
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], values)
    whole, none = run(started(Controller(skill, RATE)), lambda k: np.ma.MaskedArray(counts), ticks=200)
    assert Status.REJECTED not in none[-1]
    assert np.isfinite(whole["deviation"][-1]).all()


@pytest.mark.parametrize("count", [0, OFFSET_SAMPLES - 1])
def test_without_offset_there_is_no_feedback_in_the_whole_run(count):
    skill = steady_skill(np.random.default_rng(6))
    limits = Limits(offset_within_s=0.1)
    sensor = {k: BASE for k in [*range(0, 10 * count, 10), *range(101, 5000)]}.get
    outputs, flags = run(started(Controller(bounded(skill, limits), 1000.0)), sensor)
    still, _ = run(started(Controller(skill, 1000.0, feedback=False)))
    assert all(Status.WAITING in flag and Status.NO_OFFSET not in flag for flag in flags[:101])
    assert all(Status.NO_OFFSET in flag and Status.WAITING not in flag for flag in flags[101:])
    assert not outputs["coupling"].any()
    assert np.isnan(outputs["deviation"]).all()
    np.testing.assert_array_equal(outputs["orientation"], still["orientation"])


def test_counts_so_large_that_the_network_overflows_ask_for_nothing():
    network = random_network(np.random.default_rng(8), size=20.0)
    fine = replace(network, input_scale=np.full(6, 1e-3))  # what a channel that never moved in training gives
    skill = random_skill(np.random.default_rng(8), on_axis({"tilt": fine}, AXIS))
    huge = 1e308 * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    outputs, flags = run(started(Controller(skill, RATE)), lambda k: BASE if k < 30 else huge)
    overflows = [index for index, flag in enumerate(flags) if flag & Status.REJECTED]
    assert (outputs["primitive"][overflows[1:-1]] == 1).all()
    assert len(overflows) > 50
    for name in (*ORIENTATION, "coupling"):
        assert np.isfinite(outputs[name]).all()
    assert not outputs["coupling"].any()


@pytest.mark.parametrize(
    "counts",
    [
        *(np.zeros((1, 6)), 3.0, ["low"] * 6, np.array([None, [1]] * 3, object)),
        *([[1.0, 2.0], [3.0]], [1.0, 2.0, 3.0, 4.0, 5.0, [6.0, 7.0]], [None] * 6, "123456", b"123456"),
        *(np.ones(6, int).astype(kind) for kind in ("complex", "datetime64[s]", "S1", bool, object)),
    ],
)
def test_a_sample_of_another_size_or_kind_is_an_error_and_nothing_moves(counts):
    controller = started(Controller(with_feedback(np.random.default_rng(9)), RATE))
    with pytest.raises(InputError, match="a sensor sample has 6"):
        controller.tick(counts)
    assert controller.time == 0.0


BOX = Workspace(np.array([-0.1, -0.1, 0.0]), np.array([0.4, 0.4, 0.5]))


@pytest.mark.parametrize("at_primitive", [0, 1, 2, "held"])
@for_few_rngs
def test_a_moved_goal_is_reached_without_a_jump(at_primitive, rng):
    skill = random_skill(rng)
    switches = np.cumsum([0, *(round(p.duration * RATE) for p in skill.primitives)])
    running = 2 if at_primitive == "held" else at_primitive
    at = switches[3] + 15 if at_primitive == "held" else switches[running : running + 2].sum() // 2
    goal, shift, turn = skill.primitives[-1], random_vectors(rng, 0.1), random_vectors(rng, 0.5)
    position = goal.position.goal + shift
    orientation = quaternion.product(quaternion.from_rotation_vector(turn), goal.orientation.goal)
    controller, free = started(Controller(skill, RATE)), started(Controller(skill, RATE))
    run(controller, ticks=at)
    controller.move_goal("scrape", position, orientation)
    moved, _ = run(controller, ticks=2)
    for _ in range(2500 - at):
        controller.tick(None)
    unmoved, _ = run(free, ticks=at + 2)
    for name in (*POSITION, *ORIENTATION):
        scale = np.abs(unmoved[name]).max()
        np.testing.assert_allclose(moved[name][0], unmoved[name][at], atol=1e-9 * scale)
    tau = canonical.time_constant(skill.primitives[running].duration)
    fastest = ALPHA * BETA * ALPHA_G / tau**3 / RATE  # of the acceleration in a tick, per shift of the goal
    for name, distance in (("acceleration", shift), ("angular_acceleration", turn)):
        change = np.linalg.norm(moved[name][1] - unmoved[name][at + 1])
        assert change <= (1.0 if running == 2 else 0.0) * fastest * 1.1 * np.linalg.norm(distance) + 1e-9
    np.testing.assert_allclose(controller.position, position, atol=1e-6)
    assert quaternion.angle_between(controller.orientation, orientation) < 1e-6


@for_few_rngs
def test_a_later_goal_that_is_moved_is_as_good_as_given_from_the_start(rng):
    skill = random_skill(rng)
    goals = sequence.default_goals(skill.primitives)
    goals[1] = PoseGoal(goals[1].position + random_vectors(rng, 0.1), random_orientations(rng))
    given_first, _ = run(started(Controller(skill, RATE, goals=goals)))
    controller = started(Controller(skill, RATE))
    begin, _ = run(controller, ticks=60)  # within `down`
    controller.move_goal(1, goals[1].position, goals[1].orientation)
    rest, _ = run(controller)
    whole = {name: np.concatenate([begin[name], rest[name]]) for name in begin}
    assert_motions_agree(whole, given_first)


def test_a_goal_that_cannot_be_moved_is_an_error():
    skill = random_skill(np.random.default_rng(12))
    controller = started(Controller(skill, RATE))
    run(controller, ticks=round(RATE * skill.primitives[0].duration) + 30)
    point, unit = np.zeros(3), quaternion.IDENTITY
    for arguments, message in (
        (("down", point, unit), "'down' has ended"),
        (("up", point, unit), "no primitive 'up'"),
        ((3, point, unit), "no primitive 3"),
        ((1.5, point, unit), "no primitive 1.5"),
        ((None, point, unit), "no primitive None"),
        (("tilt", np.array([0.0, np.nan, 0.0]), unit), "goal of 'tilt' must be 3 finite numbers"),
        (("tilt", point, 1.1 * unit), "goal orientation of 'tilt' must have norm 1"),
    ):
        with pytest.raises(InputError, match=message):
            controller.move_goal(*arguments)


@for_few_rngs
def test_via_points_are_passed_exactly_and_nothing_else_changes(rng):
    skill = random_skill(rng)
    free, _ = run(started(Controller(skill, RATE)))
    controller = started(Controller(skill, RATE))
    begin, _ = run(controller, ticks=20)
    place = {"down": 0.4, "scrape": 0.3}  # of the running primitive and of a later one
    points = {}
    for name, phase in place.items():
        index = NAMES.index(name)
        at = np.flatnonzero((free["primitive"] == index) & (free["phase"] <= phase))[0]
        points[at] = free["position"][at] + random_vectors(rng, 0.015)
        controller.add_via_point(name, phase, points[at])
    rest, _ = run(controller)
    whole = {name: np.concatenate([begin[name], rest[name]]) for name in begin}
    for at, point in points.items():
        np.testing.assert_allclose(whole["position"][at], point, atol=1e-12)
    ends = np.flatnonzero(np.diff(free["primitive"])) + 1
    for name in POSITION:  # the detour starts from where the hand is, and ends with its primitive
        scale = np.abs(free[name]).max()
        for same in (slice(0, 21), slice(ends[0], ends[1]), slice(-1, None)):
            np.testing.assert_allclose(whole[name][same], free[name][same], atol=2e-3 * scale)
    detour = np.linalg.norm(whole["position"] - free["position"], axis=1)
    largest = [np.linalg.norm(point - free["position"][at]) for at, point in points.items()]
    np.testing.assert_allclose(detour.max(), max(largest), rtol=1e-2)  # no overshoot beyond that of sampling
    jumps, before = (np.abs(np.diff(one["acceleration"], axis=0)).max() for one in (whole, free))
    spans = [
        np.diff([first, at, end]).min() / RATE
        for first, at, end in zip((20, ends[1]), points, (ends[0], len(free["time"]) - 1), strict=True)
    ]
    jerk = max(60.0 * size / span**3 for size, span in zip(largest, spans, strict=True))  # of minimum jerk
    assert jumps <= before + 1.1 * jerk / RATE


@for_few_rngs
def test_a_via_point_holds_when_a_goal_moves_and_in_a_copy(rng):
    skill = random_skill(rng)
    durations = [3.0, 3.0, 3.0]
    controller = started(Controller(skill, RATE, durations))
    run(controller, ticks=20)
    point = POINTS[:2].mean(axis=0) + random_vectors(rng, 0.02)
    controller.add_via_point("down", 0.25, point)
    run(controller, ticks=20)
    goal = POINTS[1] + random_vectors(rng, 0.02)
    controller.move_goal("down", goal)
    copied, _ = run(copy.copy(controller))
    moved, _ = run(controller)
    np.testing.assert_array_equal(moved["position"], copied["position"])
    at = np.flatnonzero((moved["primitive"] == 0) & (moved["phase"] <= 0.25))[0]
    np.testing.assert_allclose(moved["position"][at], point, atol=1e-12)
    other = started(Controller(skill, RATE, durations))
    run(other, ticks=40)
    other.move_goal("down", goal)
    direct, _ = run(other)
    end = np.flatnonzero(moved["primitive"] == 1)[0]
    np.testing.assert_allclose(moved["position"][end:], direct["position"][end:], atol=1e-6)
    again, _ = run(started(controller))  # the next run has no via points
    free, _ = run(started(Controller(skill, RATE, durations)))
    np.testing.assert_array_equal(again["position"], free["position"])


@for_few_rngs
def test_a_goal_moves_also_just_before_a_via_point(rng):
    """The hand then passes it as planned: in a few ticks, a goal moves it by little."""
    skill, durations = random_skill(rng), [3.0, 3.0, 3.0]
    controller, direct = (started(Controller(skill, RATE, durations)) for _ in range(2))
    point = POINTS[:2].mean(axis=0) + random_vectors(rng, 0.02)
    controller.add_via_point("down", 0.25, point)
    ticks = 0
    while controller.phase > 0.255:
        controller.tick(None)
        ticks += 1
    run(direct, ticks=ticks)
    goal = POINTS[1] + random_vectors(rng, 0.02)
    for one in (controller, direct):
        one.move_goal("down", goal)
    assert controller.phase > 0.25
    while controller.phase > 0.25:
        controller.tick(None)
        ticks += 1
    np.testing.assert_allclose(controller.position, point, atol=1e-4)
    for one in (controller, direct):
        while one.primitive == 0:
            one.tick(None)
    np.testing.assert_allclose(controller.position, direct.position, atol=1e-6)


def test_a_via_point_that_cannot_be_passed_is_an_error_and_nothing_moves():
    skill = replace(random_skill(np.random.default_rng(12)), workspace=BOX)
    controller = started(Controller(skill, RATE))
    run(controller, ticks=round(RATE * skill.primitives[0].duration) + 30)
    near, passed = controller.position + 0.001, controller.phase
    planned = controller._plan.position_forcing.copy()
    for arguments, message in (
        (("down", 0.5, near), "'down' has ended"),
        (("up", 0.5, near), "no primitive 'up'"),
        (("tilt", 1.5, near), "at phase 1.5, which is not ahead"),
        (("tilt", 0.0, near), "at phase 0, which is not ahead"),
        (("tilt", passed + 0.01, near), "which is not ahead"),
        (("tilt", np.nan, near), "which is not ahead"),
        (("tilt", "late", near), "must be a number"),
        (("tilt", passed - 0.02, near), "less than 10 ticks from now"),
        (("scrape", 0.99, near), "less than 10 ticks from now, or from its start"),
        (("tilt", 0.0142, near), "less than 10 ticks from the end"),
        (("tilt", 0.3, np.full(3, np.nan)), "via point of 'tilt' must be 3 finite numbers"),
        (("tilt", 0.3, np.array([0.0, 0.0, 2.0])), "via point of 'tilt' is outside the workspace"),
        (("tilt", 0.3, np.array([0.35, 0.35, 0.45])), "faster than the movement itself"),
    ):
        with pytest.raises(InputError, match=message):
            controller.add_via_point(*arguments)
        np.testing.assert_array_equal(controller._plan.position_forcing, planned)
    with pytest.raises(RuntimeError, match="comes before add_via_point"):
        Controller(skill, RATE).add_via_point("down", 0.5, near)


@pytest.mark.parametrize(
    ("point", "message"),
    [
        ([-0.3, 0.0, 0.3], r"x = -0.3 m is 0.2 m below \[-0.1, 0.4\]$"),
        ([0.5, -0.2, 0.3], r"x = 0.5 m is 0.1 m above \[-0.1, 0.4\]; y = -0.2 m is 0.1 m below"),
    ],
)
def test_nothing_starts_or_ends_outside_the_workspace(point, message):
    skill = replace(random_skill(np.random.default_rng(22)), workspace=BOX)
    goals, controller = sequence.default_goals(skill.primitives), started(Controller(skill, RATE))
    far = [goals[0], PoseGoal(np.array(point), goals[1].orientation), goals[2]]
    for place, ask in (
        ("goal of 'tilt'", lambda: Controller(skill, RATE, goals=far)),
        ("position at the start", lambda: controller.start(point, UNIT)),
        ("goal of 'scrape'", lambda: controller.move_goal("scrape", np.array(point))),
    ):
        with pytest.raises(InputError, match=f"{place} is outside the workspace of the skill: {message}"):
            ask()


def test_nothing_starts_or_ends_far_from_the_demonstrated_orientation():
    """As in position; the likely cause is a quaternion (x, y, z, w)."""
    skill = replace(random_skill(np.random.default_rng(22)), workspace=BOX)
    start, goals = sequence.default_start(skill.primitives), sequence.default_goals(skill.primitives)
    controller = Controller(skill, RATE)

    def turned(q, degrees):
        about = np.radians(degrees) * np.array([0.6, 0.0, 0.8])
        return quaternion.product(quaternion.from_rotation_vector(about), q)

    controller.start(start.position, -turned(start.orientation, 59.0))
    controller.move_goal(1, goals[1].position, turned(goals[1].orientation, 59.0))
    before = controller.orientation.copy()
    last = turned(goals[1].orientation, 61.0)
    far = [goals[0], PoseGoal(goals[1].position, last), goals[2]]
    for ask, place, degrees in (
        (lambda: controller.start(start.position, turned(start.orientation, 61.0)), "at the start", 61),
        (lambda: controller.start(start.position, np.roll(start.orientation, -1)), "at the start", 175),
        (lambda: Controller(skill, RATE, goals=far), "goal orientation of 'tilt'", 61),
        (lambda: controller.move_goal(1, goals[1].position, last), "goal orientation of 'tilt'", 61),
    ):
        message = f"({place}) is {degrees} degrees .* more than 60: .* scalar-first \\(w, x, y, z\\)"
        with pytest.raises(InputError, match=message):
            ask()
    np.testing.assert_array_equal(controller.orientation, before)
    run(controller)


UNIT = quaternion.IDENTITY


@pytest.mark.parametrize(
    ("start", "arguments", "message"),
    [
        (([0.0, np.nan, 0.0], UNIT), {}, "position at the start must be 3 finite numbers"),
        ((np.zeros(3), 1.01 * UNIT), {}, "orientation at the start must have norm 1, has 1.01"),
        ((np.zeros(3), None), {}, "orientation at the start must be 4 finite numbers"),
        ((POINTS[1], UNIT), {}, r"'down' from .* local frame"),  # there is no way to its goal
        ((), {"rate_hz": 0.0}, "rate of the controller"),
        *(
            ((), {"rate_hz": rate}, "rate of the controller must be a number")
            for rate in ("1000", b"1000", None, True, 300j, [300.0], [[1.0], 2.0], np.array(300, object))
        ),
        *(
            ((), {"rate_hz": rate}, "rate of the controller must be positive, and at most 10000 Hz")
            for rate in (-300.0, np.nan, np.inf, 1e6, np.ma.masked)
        ),
        *(
            ((), {"durations": [1.0, odd, 1.0]}, "duration of 'tilt' must be a number")
            for odd in ("1.0", None, True, [1.0], 1j)
        ),
        *(
            ((), {"durations": [1.0, odd, 1.0]}, "duration of 'tilt' must be a tick at least")
            for odd in (-1.0, np.nan, -np.inf)
        ),
        ((), {"durations": [1.0, np.inf, 1.0]}, "more than 10000000 ticks"),
        ((), {"durations": [1.0, 1e308, 1.0]}, "more than 10000000 ticks"),
        ((), {"durations": "111"}, "duration of 'down' must be a number"),
        ((), {"durations": 1.0}, "durations must be one per primitive"),
        ((), {"goals": [POINTS[0]] * 3}, "goal of 'down' must be a PoseGoal"),
        ((["0", "0", "0"], UNIT), {}, "position at the start must be 3 finite numbers"),
        (([0.0, [1.0], 0.0], UNIT), {}, "position at the start must be 3 finite numbers"),
        ((np.ma.MaskedArray(np.zeros(3), [0, 1, 0]), UNIT), {}, "position at the start must be 3 finite"),
        ((np.zeros(3), UNIT > 0.5), {}, "orientation at the start must be 4 finite numbers"),
        ((), {"durations": [1.0, 1.0]}, "2 durations for 3 primitives"),
        ((), {"durations": [1.0, 0.0, 1.0]}, "duration of 'tilt' must be a tick at least"),
        ((), {"durations": [1.0, 1e9, 1.0]}, "more than 10000000 ticks"),
        ((), {"goals": [PoseGoal(np.zeros(3), UNIT)]}, "1 goals for 3 primitives"),
        ((), {"goals": [PoseGoal(np.zeros(3), 2 * UNIT)] * 3}, "goal orientation of 'down' must have norm 1"),
    ],
)
def test_a_run_that_cannot_be_planned_or_started_is_an_error(start, arguments, message):
    skill = random_skill(np.random.default_rng(13))
    goals = {"goals": [PoseGoal(POINTS[1], UNIT), *sequence.default_goals(skill.primitives)[1:]]}
    with pytest.raises(InputError, match=message):
        Controller(skill, **({"rate_hz": RATE} | goals | arguments)).start(*start)


def test_numbers_of_any_real_type_are_the_same_numbers():
    skill = random_skill(np.random.default_rng(13))
    plain = started(Controller(skill, 300.0, [1.0, 2.0, 1.0]))
    start = sequence.default_start(skill.primitives)
    for rate, durations in (
        (np.int16(300), np.array([1, 2, 1], np.uint8)),
        (np.array(300.0), (1, np.float32(2.0), np.array(1))),
    ):
        controller = Controller(skill, rate, durations)
        controller.start(start.position.tolist(), tuple(start.orientation))
        for _ in range(20):
            controller.tick(None)
        assert controller.time == 19 / 300.0
    for _ in range(20):
        plain.tick([300] * 6)
    np.testing.assert_array_equal(controller.orientation, plain.orientation)


def test_nothing_moves_before_the_start():
    controller = Controller(random_skill(np.random.default_rng(13)), RATE)
    for ask in (lambda: controller.tick(None), lambda: controller.move_goal(0, np.zeros(3))):
        with pytest.raises(RuntimeError, match=r"start\(\) comes before"):
            ask()


def test_ticks_write_into_the_same_arrays_and_keep_no_memory():
    rng = np.random.default_rng(16)
    networks = {"tilt": {axis: random_network(rng) for axis in AXES}}
    skill, counts = random_skill(rng, networks), BASE + rng.normal(size=6)
    controller = started(Controller(skill, RATE))
    held = (*POSITION, *ORIENTATION, "deviation", "coupling")
    arrays = [getattr(controller, name) for name in held]
    for _ in range(10):
        controller.tick(counts)
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        for _ in range(2000):  # through both switches and the end
            controller.tick(counts)
        after, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert controller.finished
    assert after - before < 1000
    assert peak - before < 10_000
    for name, array in zip(held, arrays, strict=True):
        assert getattr(controller, name) is array


def test_no_tick_compiles_anything():
    from structlearn.feedback import controller_tick

    rng = np.random.default_rng(17)
    controller = started(Controller(with_feedback(rng), RATE))
    compiled = len(controller_tick.tick.signatures)
    run(controller, touching(rng))
    run(started(Controller(random_skill(rng, channels=3), RATE)), lambda k: np.zeros(3))
    assert len(controller_tick.tick.signatures) == compiled  # other sizes, the same code


def test_the_bound_follows_from_the_largest_demonstrated_coupling():
    assert largest_coupling([np.array([1.0, -6.0]), np.ones((3, 2))]) == 9.0
    shown = {"z": [np.array([0.2, -0.4])], "ry": [np.ones(3), np.full(3, -2.0)]}
    fading = Limits(fade_s=0.2, stale_after_s=0.3, offset_within_s=0.4)
    limits = demonstrated_limits(shown, fading)
    assert limits == fading.model_copy(update={"largest_coupling": {"z": 0.6000000000000001, "ry": 3.0}})
    np.testing.assert_allclose(limits.of(("ry", "z"), 0.01), [[3.0, 0.6], [0.15, 0.03]])
    with pytest.raises(InputError, match="the limits say no largest coupling term for rx"):
        limits.of(("ry", "rx"), 0.01)
