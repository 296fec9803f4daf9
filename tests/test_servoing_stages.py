"""What the stages of the servoing testbed wrote."""

from dataclasses import fields
from functools import reduce
from operator import getitem

import numpy as np
import yaml
from committed import committed

from structlearn.ground.artefacts import read_table
from structlearn.ground.params import Population
from structlearn.reporting.studies import read_description
from structlearn.tactile.geodesics import read_geodesics
from structlearn.tactile.touch_dataset import chains, read_dataset
from structlearn.testbeds.servoing.protocol.servo_variants import Variant, variants


def test_what_is_recorded_becomes_samples_with_distances(reduced_project):
    """Of two places a turn, which touches twice, and a swipe, which touches four times, each twice."""
    files = list((reduced_project / "data/raw/servoing").glob("*.mcap"))
    assert len(files) == 8
    dataset = read_dataset(reduced_project / "data/servoing/touch.safetensors")
    assert dataset.contact.max() + 1 == 4 * 2 + 4 * 4
    assert len(chains(dataset, 3)) > 1000
    geodesics = read_geodesics(reduced_project / "data/servoing/geodesics.safetensors")
    assert geodesics.distance.shape == (1, 300, 300)
    assert np.isfinite(geodesics.distance).all()
    truth = read_table(reduced_project / "data/servoing/true_contacts.parquet")
    assert truth["trial"].nunique() == len(files)


def test_all_controllers_meet_the_same_trials(reduced_project):
    """Whatever they make of them: start and target of a trial are the same in every controller's rows."""
    trials, paths, progress = (
        read_table(reduced_project / f"data/servoing/servo/{name}.parquet")
        for name in ("trials", "paths", "progress")
    )
    keys = [field.name for field in fields(Variant)]
    groups = trials.groupby(keys)
    assert len(groups) == len(variants(3)) == progress.groupby(keys).ngroups
    assert set(groups.size()) == {2 * 3}
    contacts = trials.filter(regex="^(start|target)_._m$|_load_n$").columns
    for _, rows in groups:
        np.testing.assert_array_equal(rows[contacts], trials[contacts][: 2 * 3])
    shown = paths.groupby([*keys, "seed", "trial"]).size()
    assert len(shown) == 6 * 2
    assert paths.filter(like="electrode_").shape[1] == 19


def test_another_skin_goes_the_same_way(reduced_project):
    latent, directions, trials = (
        read_table(reduced_project / f"data/servoing/{name}.parquet")
        for name in ("other_skins/latent", "other_skins/directions", "servo/other_skins")
    )
    assert all(set(table["skin"]) == {"sphere"} for table in (latent, directions, trials))
    assert set(trials["form"]) == {"published", "resting"}
    assert np.isfinite(latent["reconstruction"]).all()


def test_what_is_reported_is_of_the_first_of_the_test_set(root):
    """Demonstrations, models and contacts; studies repeat it on the others, and tune on none of them."""
    people = committed(Population, "servo_people")
    parameters = yaml.safe_load((root / "params.yaml").read_text())
    seeds = ("toucher.seed", "toucher.sensor_seed", "train_latent.training.seed", "servo.seed")
    for key in seeds:
        assert reduce(getitem, key.split("."), parameters) == people.test[0], key
    studies = root / "benchmarks/studies"
    assert set(read_description("servoing/people", studies).repeats.seeds) == set(seeds)
    for name in ("controller", "loss_weights"):
        for repeat in read_description(f"servoing/{name}", studies).repeats:
            assert {repeat[key] for key in seeds} <= set(people.tuning)
