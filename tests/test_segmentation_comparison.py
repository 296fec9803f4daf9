from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from reporting_scraping import PARAMETERS, demonstration, noise_table

from structlearn.primitives.sequence import largest_acceleration_jump
from structlearn.segmentation.cut_errors import (
    distances_to_reference_mm,
    errors_by_level,
    errors_by_seed,
    paired_comparison,
    wins_at_every_noise_level,
)
from structlearn.segmentation.segments import cut


def test_pairs_decide_where_people_differ_more_than_methods():
    by_seed = errors_by_seed(noise_table(advantage_ms=5.0))
    table = paired_comparison(by_seed)
    assert (table["verdict"] == "better").all()
    assert table["difference_ms"].to_numpy() == pytest.approx(5.1, abs=0.1)
    assert (table["seeds"] == 3).all()
    by_level = errors_by_level(by_seed)
    assert (by_level["half_width_ms"] > 5.0).all()  # unpaired, the people's spread hides the difference
    assert wins_at_every_noise_level(by_level)


def test_worse_and_undecided_are_said_too():
    worse = paired_comparison(errors_by_seed(noise_table(advantage_ms=-5.0)))
    assert (worse["verdict"] == "worse").all()
    undecided = paired_comparison(errors_by_seed(noise_table(advantage_ms=-0.1)))
    assert (undecided["verdict"] == "undecided").any()


def test_left_out_demonstrations_are_no_method():
    assert "left_out" not in set(errors_by_seed(noise_table())["method"])


def test_distance_to_the_reference_does_not_see_where_a_segment_lies():
    first = demonstration(0)
    shifted = replace(first, name="shifted", position=first.position + np.array([0.1, -0.2, 0.3]))
    segmentation = cut([first, shifted], PARAMETERS)
    for method in ("zvc", "wls"):
        distances = distances_to_reference_mm([first, shifted], segmentation, "down", method, "z")
        assert list(distances.index) == ["shifted"]
        assert distances.to_numpy() == pytest.approx(0.0, abs=1e-6)


def test_jump_of_the_acceleration_is_found_at_switches_only():
    table = pd.DataFrame({"primitive": list("aabb"), "ax": [0.0, 4.0, 5.0, 0.0], "ay": 0.0, "az": 0.0})
    assert largest_acceleration_jump(table) == pytest.approx(1.0 / 5.0)
    assert largest_acceleration_jump(table[table["primitive"] == "a"]) == 0.0
