"""Populations: what is judged is apart from what was tuned on."""

from pathlib import Path

import pytest
import yaml
from pydantic import ValidationError

from structlearn.core.params import Population


def test_tuning_and_test_seeds_are_apart():
    assert Population(tuning=[1, 2], test=[11, 12]).shown == 1
    with pytest.raises(ValidationError, match=r"seeds \[2\] are in `tuning` and in `test`"):
        Population(tuning=[1, 2], test=[2, 3])
    with pytest.raises(ValidationError, match="stands twice"):
        Population(tuning=[1], test=[2, 2])
    with pytest.raises(ValidationError, match="at least 1 item"):
        Population(tuning=[], test=[2])


def test_every_population_of_the_parameters_is_apart(root: Path):
    parameters = yaml.safe_load((root / "params.yaml").read_text())
    populations = {
        key: value
        for key, value in parameters.items()
        if isinstance(value, dict) and set(value) == {"tuning", "test"}
    }
    assert set(populations) == {"scraping_people", "obstacle_people", "dynamics_robots", "servo_people"}
    for value in populations.values():
        Population.model_validate(value)
