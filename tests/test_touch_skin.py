"""Touches of a skin: blocks held out, maps, forces and servoing on toy runs; findings on made-up tables."""

from dataclasses import replace
from functools import lru_cache
from itertools import product

import numpy as np
import pandas as pd
import pytest
from committed import committed_entry
from viewer_files import contents, note

from structlearn.core.errors import MissingInputError
from structlearn.palette import PLATE_CORNERS, place_colours
from structlearn.readers.touch_log import TouchLog
from structlearn.tactile.pressed_skin import held_out
from structlearn.tasks.touch import skin_force, skin_readings, skin_within_runs
from structlearn.tasks.touch import touch_names as names
from structlearn.tasks.touch.learning import learn_touch, table_of
from structlearn.tasks.touch.skin_section import SkinRuns, find_skin
from structlearn.tasks.touch.skin_touches import folds_of, gathered
from structlearn.tasks.touch.view import skin
from structlearn.viewer.recording import write

CHANNELS = tuple(str(channel) for channel in range(15))


def small(steps=150, folds=2, block_mm=3.0):
    """Parameters of a quick training."""
    spaces = {"seeds": 1, "pair_pool": 5000, "evaluation_pairs": 2000}
    spaces["training"] = {"steps": steps, "evaluate_every": steps}
    servo = {"walks": 500, "trials": 8, "steps": 10}
    its = {"copies": 2, "rival_samples": 80, "spaces": spaces, "servo": servo, "published": {"epochs": 40}}
    return committed_entry("eflesh", tuned_on=["a"], folds=folds, block_mm=block_mm, **its)


SMALL = small()


def grid(size, passes=1):
    """Places (N, 2) m, 1 mm apart, exact to tenths of a micrometre as the logs' are."""
    x, y = np.meshgrid(np.arange(size), np.arange(size), indexing="ij")
    places = np.tile(1e-3 * np.column_stack([x.ravel(), y.ravel()]), (passes, 1))
    return places + 6.1e-8 * (np.arange(len(places))[:, None] % 2)


def toy_run(name, seed, depth_mm=0.0, size=10):
    """Presses of a skin whose channels are bumps of either sign; deeper presses are stronger."""
    rng, bumps = np.random.default_rng(seed), np.random.default_rng(0)
    place = grid(size, passes=2)
    depth = 1e-3 * depth_mm * rng.uniform(-1, 1, len(place))
    centres = 1e-3 * bumps.uniform(0, size, (15, 2))
    squared = np.square(place[:, None] - centres).sum(axis=-1)
    counts = bumps.choice([-300, 300], 15) * np.exp(-squared / (2 * 0.006**2)) * np.exp(-300 * depth)[:, None]
    counts += rng.normal(size=counts.shape)
    place = np.column_stack([place, depth])
    return TouchLog(name, CHANNELS, counts, place, np.arange(len(place)) * 4.0)


def toy_strokes(name, presses=5, gain=1.0):
    """Depth, channels that follow it 0.35 s later, and a scale 0.6 s later that reads every other row."""
    time = np.arange(0, 20.0 * presses, 0.2)

    def depth(at):
        return 6e-3 * (1 - np.cos(2 * np.pi * np.maximum(at, 0) / 20.0))

    force = 2e5 * gain * depth(time - 0.6) ** 2
    counts = np.outer(2e5 * depth(time - 0.35), np.random.default_rng(3).normal(size=15))
    place = np.column_stack([np.zeros((len(time), 2)), -depth(time)])
    weighed = np.where(np.arange(len(time)) % 2, np.nan, force)
    return TouchLog(name, CHANNELS, counts, place, time, weighed)


def touches(log, parameters=SMALL):
    """The touches of one recording."""
    return gathered([log], parameters)[0][0]


@pytest.fixture(scope="module")
def learned():
    runs = [toy_run("a", 1, depth_mm=1.0), toy_run("b", 2)]
    return learn_touch([*runs, toy_strokes("c"), toy_strokes("d")], SMALL)


def test_no_two_neighbours_are_held_out_at_once():
    block, fold = held_out(grid(31), 5e-3, 4)
    numbers, first, sizes = np.unique(block, return_index=True, return_counts=True)
    assert (len(numbers), sizes.max()) == (36, 36)  # the last row belongs to the last blocks
    squares = fold[first].reshape(6, 6)
    assert (fold == fold[first][block]).all()
    assert (np.diff(squares, axis=0) != 0).all()
    assert (np.diff(squares, axis=1) != 0).all()
    assert len({squares[0, 0], squares[0, -1], squares[-1, 0], squares[-1, -1]}) == 4


def test_readings_of_places_are_those_of_known_functions():
    """A polynomial of polynomials; a Gaussian process also of what never varies."""
    known, new = np.random.default_rng(0).normal(size=(60, 2)), np.random.default_rng(1).normal(size=(20, 2))

    def wanted(at):
        return np.column_stack([at[:, 0] ** 3 - at[:, 1], at[:, 0] * at[:, 1] ** 2])

    np.testing.assert_allclose(skin_readings.polynomial(known, wanted(known), 3)(new), wanted(new), atol=1e-9)
    known = np.linspace(-2, 2, 80)[:, None]
    waves = np.column_stack([np.sin(known[:, 0]), np.full(80, 0.143)])
    found = skin_readings.gaussian_process(known, waves, 40)(np.array([[0.31], [-1.17]]))
    np.testing.assert_allclose(found, [[np.sin(0.31), 0.143], [np.sin(-1.17), 0.143]], atol=0.02)


def test_the_map_is_the_skin_and_rivals_have_none(learned):
    _, tables = learned
    errors = tables["errors"].groupby(["new", "learned_from", "model"])[["map_nmse", "latent_mm"]].mean()
    for run in ("a", "b"):
        its = errors.loc[names.NEW_RUN, run]
        assert its.loc["structured", "map_nmse"] < 0.2
        assert its.loc["structured", "map_nmse"] < 0.5 * its.loc["3 principal components", "map_nmse"]
        assert its.loc["Gaussian process", "latent_mm"] < 1.0
    by_run = tables["errors"].groupby(["learned_from", "model"])["depth_nmse"]
    known = by_run.apply(lambda its: its.notna().any())
    assert known.loc["a"].all()
    assert not known.loc["b"].any()  # it knows one depth only


def test_a_run_of_one_depth_acts_on_presses_of_that_depth(learned):
    skins, tables = learned
    assert len(skins["a"].units.action_scale) == 3
    assert len(skins["b"].units.action_scale) == 2
    runs = touches(toy_run("b", 2)), touches(toy_run("a", 1, depth_mm=1.0))
    one_depth = table_of(*runs, 1e-3 * SMALL.servo.depth_mm)
    assert 0 < len(one_depth.pressure) < 288
    assert np.abs(one_depth.place[:, 2]).max() <= 0.5e-3
    servo = tables["servo"]
    assert set(servo["controller"]) == {names.ADAPTIVE, *names.PUBLISHED_SERVO}
    assert (servo.loc[servo["arrived"], "left_mm"] <= SMALL.servo.tolerance_mm).all()


def test_a_lag_is_found_between_steps():
    time = np.arange(0, 60, 0.07)
    cause = np.sin(0.9 * time) + 0.4 * np.sin(2.3 * time)
    effect = 3.0 * (np.sin(0.9 * (time - 0.437)) + 0.4 * np.sin(2.3 * (time - 0.437))) + 1.0
    assert skin_force.lag_behind(time, cause, time, effect, 1.0) == pytest.approx(0.437, abs=5e-3)
    assert skin_force.lag_behind(time, cause, time, cause, 1.0) == pytest.approx(0.0, abs=5e-3)


def test_presses_part_halfway_between_two():
    force = np.array([0, 9, 9, 0, 0, 0, 9, 0, 9.0])
    np.testing.assert_array_equal(
        skin_force.press_numbers(np.arange(9.0), force, 5.0), [0, 0, 0, 0, 1, 1, 1, 2, 2]
    )
    np.testing.assert_array_equal(skin_force.press_numbers(np.arange(2.0), force[1:3], 5.0), [0, 0])


def test_lags_and_forces_are_found(learned):
    _, tables = learned
    np.testing.assert_allclose(tables["lags"][["signals_s", "force_s"]], [[0.35, 0.6]] * 2, atol=0.03)
    errors = tables["force"].groupby(["new", "model"])["rms_n"].mean()
    assert errors[names.NEW_RUN, names.QUADRATIC] < 0.5
    assert set(tables["force"]["press"]) == set(range(5))
    published = tables["published"].set_index(["quantity", "run"])["rms"]  # every place and depth recurs
    assert published["place_mm"].max() < 0.5
    assert published["force_n"].max() < 1.5  # of 29 N
    network = tables["published"].set_index("quantity")["network_rms"]
    assert network["place_mm"].isna().all()
    assert network["force_n"].max() < 3.0
    ratios = tables["rivals"].groupby("run")["over_network"]
    assert set(ratios.size()) == {skin_within_runs.TENTHS}
    whole = tables["published"].dropna().set_index("run")
    whole = whole["rms"] / whole["network_rms"]  # a mean of its tenths, each weighed by the network's error
    assert ((ratios.min() < whole) & (whole < ratios.max())).all()


def test_a_scale_that_says_too_little_is_left_aside(capsys):
    mute = replace(toy_strokes("mute"), force=np.full(len(toy_strokes("mute").time), np.nan))
    quiet, few, sound = toy_strokes("c", gain=0.1), toy_strokes("few", presses=3), toy_strokes("d", presses=4)
    errors, lags, traces = skin_force.force_errors([mute, quiet, few, sound], SMALL.force, 150)
    assert set(errors["learned_from"]) == set(lags["run"]) == {"d"}
    assert traces.empty
    assert capsys.readouterr().out.count("left aside: 0 presses") == 2


def test_a_run_in_one_block_has_nothing_held_out():
    spot = toy_run("spot", 2, size=3)
    with pytest.raises(MissingInputError, match="no touches in two blocks of 3 mm"):
        learn_touch([spot], SMALL)
    quick = small(5, folds=4, block_mm=4.0)
    narrow = toy_run("narrow", 2)
    strip = narrow.place[:, 0] < 4e-3
    cut = {name: getattr(narrow, name)[strip] for name in ("time", "place", "counts")}
    folds = folds_of([touches(replace(narrow, **cut), quick)])  # two blocks, of folds 0 and 2
    errors = pd.concat([skin_readings.place_errors(one)[0] for one in folds])
    assert errors.groupby("model")["block"].nunique().eq(2).all()


def both_ways(table, first, second):
    ways = (first, second), (second, first)
    its = [table.assign(learned_from=one, test_run=other) for one, other in ways]
    return pd.concat(its, ignore_index=True)


@lru_cache
def made_up():
    """Results in which every claim holds."""
    wiggle = 1 + np.linspace(-0.01, 0.01, 6)
    errors = []
    for model, first, second in product(names.SPACES, "ab", "ab"):
        ours = model == "structured"
        new = names.NEW_BLOCKS if first == second else names.NEW_RUN
        nmses = ("map_nmse", "pressure_nmse", "signal_nmse", "depth_nmse")
        columns = dict.fromkeys(nmses, (0.01 if ours else 0.5) * wiggle)
        columns |= dict.fromkeys(("latent_mm", "laid_mm"), (0.5 if ours else 2.0) * wiggle)
        columns |= {"learned_from": first, "test_run": second, "new": new, "model": model, "seed": 0}
        errors.append(pd.DataFrame({"block": range(6), "presses": 20} | columns))
    x, y = grid(5).T
    maps = pd.DataFrame({"x_m": x, "y_m": y, "z_m": 0.0, "pressure": 0.0, "map_x_m": x, "map_y_m": y})
    path = pd.DataFrame({"trial": np.repeat(range(3), 4), "step": np.tile(range(4), 3), "x_m": 0.0})
    path = path.assign(y_m=0.0, target_x_m=1e-3, target_y_m=1e-3)
    controllers = (*names.PUBLISHED_SERVO, names.ADAPTIVE)
    servo = [
        (model, controller, trial, model == "structured", 1.05 * (1 + 0.001 * (trial % 3)))
        for model, controller, trial in product(("structured", "reconstruction only"), controllers, range(20))
    ]
    servo = pd.DataFrame(servo, columns=["model", "controller", "trial", "arrived", "length_ratio"])
    servo = servo.assign(left_mm=0.5, seed=0, straight_mm=9.0)
    force = [
        (new, model, press, 0.3 + 0.01 * press, 1.0)
        for new, model, press in product((names.NEW_PRESSES, names.NEW_RUN), names.FORCE_MODELS, range(4))
    ]
    force = pd.DataFrame(force, columns=["new", "model", "press", "rms_n", "worst_n"])
    published = pd.DataFrame({"run": list("ace"), "quantity": ["place_mm", "force_n", "shear_n"]})
    lag = {"run": ["c"], "signals_s": [0.4], "force_s": [0.5], "readings": [9], "presses": [4]}
    traces = {"time_s": np.arange(9.0), "force_n": 1.0, "read_n": 1.1, "learned_from": "c"}
    tables = {
        "maps": both_ways(maps, "a", "b"),
        "paths": both_ways(path, "a", "b"),
        "servo": both_ways(servo, "a", "b"),
        "errors": pd.concat(errors, ignore_index=True),
        "force": both_ways(force, "c", "d"),
        "lags": pd.DataFrame(lag),
        "traces": pd.DataFrame(traces | {"test_run": "d"}),
        "published": published.assign(
            seen="counts", rms=0.1, readings=200, spread=5.0, network_rms=[np.nan, 0.2, 0.2]
        ).assign(network_training_rms=[np.nan, 0.1, 0.1]),
        "rivals": pd.DataFrame({"run": np.repeat(["c", "e"], 3), "over_network": [0.4, 0.5, 0.6] * 2}),
    }
    return SkinRuns(tables, ("a",))


def test_blocks_of_the_run_tuned_on_decide_nothing():
    spoiled = made_up().tables["errors"].copy()
    own = (spoiled["learned_from"] == "a") & (spoiled["test_run"] == "a")
    spoiled.loc[own, ["map_nmse", "latent_mm"]] = 99.0
    results = SkinRuns(made_up().tables | {"errors": spoiled}, ("a",))
    assert find_skin(results)["map_nmse"] == find_skin(made_up())["map_nmse"]
    alone = find_skin(SkinRuns({"errors": spoiled[own]}, ("a",)))
    assert alone["map_nmse"].reason == "no runs for it are recorded here"
    assert alone["latent_mm"].n == 0


def test_the_recording_shows_what_is_there(tmp_path):
    for there in (("maps", "paths", "traces"), ("maps", "paths"), ("traces",), ()):
        tables = {name: made_up().tables[name] for name in there}
        write(tmp_path / "skin.rrd", skin(tables, ("a",)))
        assert "recorded" in note(tmp_path / "skin.rrd")
        assert ("/map/presses" in contents(tmp_path / "skin.rrd")[1]) == ("maps" in there)


def test_places_have_the_colours_of_their_corners():
    colours = place_colours(np.array([[0, 0], [0, 1], [1, 0], [1, 1], [0.5, 0.0]]))
    hexes = [f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue in colours[:4]]
    assert hexes == [*PLATE_CORNERS[0], *PLATE_CORNERS[1]]
