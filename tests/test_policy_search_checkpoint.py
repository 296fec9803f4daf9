"""Iterations on disk: whole or not there, the last one counts, other inputs never find them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from committed import committed
from feedback_skills import random_network
from hypothesis import given
from hypothesis import strategies as st

from structlearn.policy_search import checkpoint as module
from structlearn.policy_search.checkpoint import Checkpoint, digest
from structlearn.policy_search.pi2 import PI2Parameters
from structlearn.policy_search.refinement import Progress
from structlearn.policy_search.rollouts import FEEDBACK, SAMPLE


def progress(iteration=1, rows=4):
    rng = np.random.default_rng(iteration)
    cost = rng.uniform(size=rows)
    cost[1:2] = np.nan
    history = pd.DataFrame(
        {
            "iteration": iteration,
            "kind": ([FEEDBACK] + [SAMPLE] * rows)[:rows],
            "number": range(rows),
            "cost_rad": cost,
            "norm_rad": 0.1 * cost,
            "fault": ["", "ValueError: diverged", "", ""][:rows],
        }
    )
    root = rng.normal(size=(25, 25))
    return Progress(
        iteration=iteration,
        network=random_network(rng),
        covariance=(root @ root.T).T,
        history=history,
        policies=rng.normal(size=(3 * iteration, 25)),
        samples=pd.DataFrame({"iteration": iteration, "target": rng.normal(size=6)}),
        compressed=rng.normal(size=25),
    )


@pytest.fixture
def checkpoint(tmp_path):
    return Checkpoint(tmp_path / "cache" / "0123456789abcdef")


def assert_same(found, saved):
    assert found.iteration == saved.iteration
    for name in ("covariance", "policies", "compressed"):
        np.testing.assert_array_equal(getattr(found, name), getattr(saved, name))
        assert getattr(found, name).dtype == getattr(saved, name).dtype
    pd.testing.assert_frame_equal(found.history, saved.history, check_exact=True)
    pd.testing.assert_frame_equal(found.samples, saved.samples, check_exact=True)
    assert digest(vars(found.network)) == digest(vars(saved.network))


@pytest.mark.parametrize("iteration", [0, 1, 37])
def test_an_iteration_comes_back_as_it_was(checkpoint, iteration):
    """The 0th one has no policies yet."""
    checkpoint.save(progress(iteration))
    assert_same(checkpoint.last(), progress(iteration))


def test_the_last_of_several_is_taken(checkpoint):
    assert checkpoint.last() is None
    for iteration in (0, 2, 10, 100, 1, 9):
        checkpoint.save(progress(iteration))
    assert_same(checkpoint.last(), progress(100))


def test_an_iteration_that_is_saved_again_replaces_the_old_one(checkpoint):
    checkpoint.save(progress(1, rows=2))
    checkpoint.save(progress(1))
    assert_same(checkpoint.last(), progress(1))


@pytest.mark.parametrize("writer", ["write_networks", "write_tensors", "write_table"])
def test_an_iteration_that_fails_half_way_is_not_there(checkpoint, monkeypatch, writer):
    def fail(*arguments):
        raise OSError("no space left on device")

    for saved in (None, progress(0)):
        if saved:
            checkpoint.save(saved)
        with monkeypatch.context() as patch:
            patch.setattr(module, writer, fail)
            with pytest.raises(OSError, match="no space"):
                checkpoint.save(progress(1))
        found = checkpoint.last()
        assert found is None if saved is None else found.iteration == 0
    assert [path.name for path in checkpoint.folder.iterdir()] == ["000"]


def test_what_a_kill_leaves_behind_is_not_seen_and_not_in_the_way(checkpoint, monkeypatch):
    checkpoint.save(progress(0))

    def die(*arguments):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:  # a process that is gone tidies nothing up
        patch.setattr(module, "write_table", die)
        patch.setattr("structlearn.ground.publication.shutil.rmtree", lambda *arguments, **options: None)
        with pytest.raises(KeyboardInterrupt):
            checkpoint.save(progress(1))
    assert len(list(checkpoint.folder.iterdir())) == 2
    assert_same(checkpoint.last(), progress(0))
    checkpoint.save(progress(1))
    assert_same(checkpoint.last(), progress(1))
    assert sorted(path.name for path in checkpoint.folder.iterdir()) == ["000", "001"]


def test_removed_iterations_are_gone_and_neighbours_stay(checkpoint):
    neighbour = Checkpoint(checkpoint.folder.parent / "fedcba9876543210")
    for one in (checkpoint, neighbour):
        one.save(progress(0))
    for _ in range(2):  # the second time there is nothing to remove
        checkpoint.remove()
        assert checkpoint.last() is None
        assert not checkpoint.folder.exists()
    assert neighbour.last() is not None


ARRAY = np.arange(12.0).reshape(3, 4)
VALUES = {
    "seed": 0,
    "primitive": "turn",
    "data": ARRAY,
    "search": {"samples": 38, "covariance": {"mode": "full"}},
    "arrays": {"hidden": [np.arange(2000.0), np.zeros(3)]},
    "parameters": committed(PI2Parameters, "refine.search"),
    "network": random_network(np.random.default_rng(0), inputs=1000),
}


def changed(place=1000):
    array = np.arange(2000.0)
    array[place] += 1e-9
    return array


def nudged(network):
    """Another value in the middle, where the text of a long array has dots."""
    scale = network.input_scale.copy()
    scale[500] += 1e-9
    return replace(network, input_scale=scale)


@pytest.mark.parametrize(
    ("name", "other"),
    [
        ("seed", 1),
        ("seed", "0"),
        ("seed", None),
        ("primitive", "scrape"),
        ("data", ARRAY + 1e-12),
        ("data", ARRAY.T),
        ("data", ARRAY.reshape(4, 3)),
        ("data", ARRAY.view(np.int64)),
        ("data", ARRAY.tolist()),
        ("search", {"samples": 38, "covariance": {"mode": "scaled"}}),
        ("search", {"samples": 37, "covariance": {"mode": "full"}}),
        ("arrays", {"hidden": [changed(), np.zeros(3)]}),
        ("arrays", {"hidden": [np.arange(2000.0), np.zeros(4)]}),
        ("parameters", committed(PI2Parameters, "refine.search", kl_bound=1.1)),
        ("parameters", committed(PI2Parameters, "refine.search", temperature=0.1)),
        ("network", random_network(np.random.default_rng(1), inputs=1000)),
        ("network", nudged(VALUES["network"])),
    ],
)
def test_every_value_changes_the_digest(name, other):
    assert digest(VALUES | {name: other}) != digest(VALUES)


def test_names_are_part_of_the_digest():
    assert digest({"a": 1}) != digest({"b": 1}) != digest({"a": 1, "b": 1})
    assert digest({"a": 1, "b": 2}) != digest({"a": 2, "b": 1})


def test_the_order_of_keys_and_memory_is_not_part_of_the_digest():
    turned = dict(reversed(VALUES.items()))
    turned["search"] = {"covariance": {"mode": "full"}, "samples": 38}
    turned["data"] = np.asfortranarray(ARRAY)
    turned["parameters"] = committed(PI2Parameters, "refine.search")
    assert digest(turned) == digest(VALUES)


@pytest.mark.parametrize("value", [pd.DataFrame({"a": [1]}), object(), np.array([object()]), {1, 2}])
def test_what_has_no_complete_text_is_refused(value):
    with pytest.raises(TypeError, match="cannot be part of a digest"):
        digest({"a": {"b": value}})


@given(st.dictionaries(st.text(max_size=4), st.integers() | st.text(max_size=4), max_size=4), st.randoms())
def test_a_digest_is_a_folder_name(values, random):
    name = digest(values)
    assert len(name) == 16
    assert set(name) <= set("0123456789abcdef")
    assert Path(name).name == name
    items = list(values.items())
    random.shuffle(items)
    assert digest(dict(items)) == name
