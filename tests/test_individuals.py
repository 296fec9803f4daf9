"""People who differ: draws about a median, and the share of variance between them."""

from zlib import crc32

import numpy as np
import pytest
from pydantic import Field, ValidationError

from dissertation.simulation.individuals import FARTHEST, Individual, Spread, drawn

CHOSEN = "chosen for this test"


class Walker(Individual):
    seed: int
    step_m: float = Field(gt=0, le=3)
    pauses_s: tuple[float, float]
    heading_deg: float


def walkers(**between: Spread) -> Walker:
    return Walker(seed=0, step_m=0.7, pauses_s=(0.5, 1.0), heading_deg=90.0, between=between)


def test_individuals_scatter_about_the_median_as_stated():
    spread = {"std": 0.3, "of": "log", "source": CHOSEN}
    population = walkers(step_m=Spread(**spread), heading_deg=Spread(**spread | {"of": "value", "std": 20.0}))
    people = [drawn(population, seed) for seed in range(2000)]
    logs = np.log([one.step_m / 0.7 for one in people])
    angles = np.array([one.heading_deg - 90.0 for one in people])
    for scores in (logs / 0.3, angles / 20.0):
        assert abs(np.mean(scores)) < 0.07
        assert abs(np.std(scores) - 0.96) < 0.05
        assert np.abs(scores).max() == pytest.approx(FARTHEST)
    assert abs(np.corrcoef(logs, angles)[0, 1]) < 0.07
    assert [one.seed for one in people[:3]] == [0, 1, 2]
    assert not people[0].between


def test_another_constant_that_differs_changes_no_draw_and_several_values_share_a_factor():
    pace = Spread(std=0.2, of="log", source=CHOSEN)
    one, both = (drawn(walkers(**its), 7) for its in ({"step_m": pace}, {"step_m": pace, "pauses_s": pace}))
    assert one.step_m == both.step_m != 0.7
    assert one.pauses_s == (0.5, 1.0)
    first, second = both.pauses_s
    assert second / first == pytest.approx(2.0)
    assert first != 0.5
    assert drawn(one, 7) == one


def test_what_differs_must_be_a_number_of_the_model_and_stay_in_range():
    pace = Spread(std=0.2, of="log", source=CHOSEN)
    with pytest.raises(ValidationError, match="no constant stride"):
        walkers(stride=pace)
    with pytest.raises(ValidationError, match="between is not a number"):
        walkers(between=pace)
    wild = walkers(step_m=Spread(std=2.0, of="log", source=CHOSEN))
    draws = np.array(
        [np.random.default_rng([seed, crc32(b"step_m")]).standard_normal() for seed in range(50)]
    )
    with pytest.raises(ValidationError, match="step_m"):
        drawn(wild, int(draws.argmax()))
