from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from reporting_scraping import PARAMETERS, demonstration, noise_table

from dissertation.scraping.protocol.cut_sweep import downsampling_effect
from structlearn.primitives.sequence import largest_acceleration_jump
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation import cut_errors
from structlearn.segmentation.segments import cut


@pytest.fixture(scope="module")
def segmentation(two_move_demonstrations):
    return cut(two_move_demonstrations, PARAMETERS)


def test_errors_are_found_minus_true(two_move_demonstrations, segmentation):
    errors = cut_errors.cut_errors(two_move_demonstrations, segmentation)
    row = errors[(errors["demonstration"] == "03") & (errors["primitive"] == "scrape")].iloc[0]
    found = segmentation.result("scrape", row["method"]).loc["03"]
    true = two_move_demonstrations[2].true_segments[2]
    np.testing.assert_allclose(
        [row["start_error_s"], row["end_error_s"]], [found["start_s"], found["end_s"]] - true
    )


def test_aligned_stretched_copies_coincide(two_move_demonstrations, segmentation):
    curves, names = cut_errors.aligned_segments(two_move_demonstrations, segmentation, "down", "wls", "z")
    assert curves.shape == (5, 200, 1)
    assert names == ["01", "02", "03", "04", "05"]
    assert cut_errors.spread_mm(curves) < 1.0


def test_downsampling_work_falls_with_the_square(two_move_demonstrations):
    effect = downsampling_effect(two_move_demonstrations, PARAMETERS, [1, 2, 4])
    np.testing.assert_allclose(effect["work"], [1, 1 / 4, 1 / 16], rtol=0.05)
    assert effect["work"][1] != 1 / 4  # counted: lengths are no multiples of g
    assert effect["max_shift_ms"][0] == 0.0
    assert effect["max_shift_ms"].max() < 40.0


def test_dwells_keep_the_movement_and_know_where_it_is():
    path = np.column_stack([np.linspace(0, 0.4, 500), np.zeros(500), np.zeros(500)])
    reach = Demonstration("a", np.arange(500) * 1e-3, path)
    quiet, noisy = (
        cut_errors.between_dwells(reach, (0.3, 1.0), 5.0, noise, np.random.default_rng(0))
        for noise in (0.0, 2e-3)
    )
    first, last = np.round(quiet.true_segments[0] / 1e-3).astype(int)
    np.testing.assert_array_equal(quiet.position[first : last + 1], path)
    assert (quiet.position[:first] == path[0]).all()
    assert (quiet.position[last:] == path[-1]).all()
    np.testing.assert_array_equal(noisy.true_segments, quiet.true_segments)
    np.testing.assert_allclose((noisy.position - quiet.position).std(axis=0), 2e-3)
    step = np.diff(noisy.position - quiet.position, axis=0).std()
    assert step < 2e-3 * 2 * np.pi * 5.0 * 1e-3  # smooth: slower than its cut-off


def test_pairs_decide_where_people_differ_more_than_methods():
    by_seed = cut_errors.errors_by_seed(noise_table(advantage_ms=5.0))
    table = cut_errors.paired_comparison(by_seed)
    assert (table["verdict"] == "better").all()
    assert table["difference_ms"].to_numpy() == pytest.approx(5.1, abs=0.1)
    assert (table["seeds"] == 3).all()
    by_level = cut_errors.errors_by_level(by_seed)
    assert (by_level["half_width_ms"] > 5.0).all()  # unpaired, the people's spread hides the difference
    assert cut_errors.wins_at_every_noise_level(by_level)
    for advantage, verdict in ((-5.0, "worse"), (-0.1, "undecided")):
        assert verdict in set(
            cut_errors.paired_comparison(cut_errors.errors_by_seed(noise_table(advantage)))["verdict"]
        )


def test_distance_to_the_reference_does_not_see_where_a_segment_lies():
    first = demonstration(0)
    shifted = replace(first, name="shifted", position=first.position + np.array([0.1, -0.2, 0.3]))
    segmentation = cut([first, shifted], PARAMETERS)
    for method in ("zvc", "wls"):
        curves, names = cut_errors.aligned_segments([first, shifted], segmentation, "down", method, "z")
        distances = cut_errors.distances_mm(curves, names.index(first.name))
        assert distances == pytest.approx([0.0], abs=1e-6)


def test_jump_of_the_acceleration_is_found_at_switches_only():
    table = pd.DataFrame({"primitive": list("aabb"), "ax": [0.0, 4.0, 5.0, 0.0], "ay": 0.0, "az": 0.0})
    assert largest_acceleration_jump(table) == pytest.approx(1.0 / 5.0)
    assert largest_acceleration_jump(table[table["primitive"] == "a"]) == 0.0
