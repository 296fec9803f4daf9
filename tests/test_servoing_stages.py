"""What the stages of the servoing testbed wrote."""

from dataclasses import fields
from functools import reduce
from operator import getitem

import numpy as np
import yaml
from committed import committed

from dissertation.servoing.protocol.servo_variants import ServoVariant, variants
from structlearn.core.artefacts import read_table
from structlearn.core.params import Population


def test_all_controllers_meet_the_same_trials(reduced_project):
    """Whatever they make of them: start and target of a trial are the same in every controller's rows."""
    trials, paths, progress = (
        read_table(reduced_project / f"data/servoing/servo/{name}.parquet")
        for name in ("trials", "paths", "progress")
    )
    keys = [field.name for field in fields(ServoVariant)]
    groups = trials.groupby(keys)
    assert len(groups) == len(variants(3)) == progress.groupby(keys).ngroups
    assert set(groups.size()) == {2 * 3}
    contacts = trials.filter(regex="^(start|target)_._m$|_load_n$").columns
    for _, rows in groups:
        np.testing.assert_array_equal(rows[contacts], trials[contacts][: 2 * 3])
    shown = paths.groupby([*keys, "seed", "trial"]).size()
    assert len(shown) == 6 * 2
    assert paths.filter(like="electrode_").shape[1] == 19


def test_what_is_reported_is_of_the_first_of_the_test_set(root):
    """Demonstrations, models and contacts; a study repeats it on the others."""
    people = committed(Population, "servo_people")
    parameters = yaml.safe_load((root / "params.yaml").read_text())
    seeds = ("toucher.seed", "toucher.sensor_seed", "train_latent.training.seed", "servo.seed")
    for key in seeds:
        assert reduce(getitem, key.split("."), parameters) == people.test[0], key
    study = yaml.safe_load((root / "stages/studies/studies.yaml").read_text())["servoing/people"]
    assert set(study["seeds"]) == set(seeds)
