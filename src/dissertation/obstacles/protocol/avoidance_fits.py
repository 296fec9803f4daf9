"""Training and errors of all avoidance models of the testbed (tables IV.1 and IV.2, figure IV.10).

A person's models learn from that person's demonstrations of one scenario, of one shape, or of all, and are
tested on the same held-out demonstrations. Models per setting for every person would take longer than all the
rest, so settings are divided among people (`own_scenarios`).
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import groupby
from typing import NamedTuple, TypeVar

import numpy as np
import pandas as pd
from pydantic import PositiveInt

from dissertation.obstacles.world.scenarios import Scenario, own_scenarios
from structlearn.avoidance.avoidance_dataset import AvoidanceDataset
from structlearn.avoidance.avoidance_network import AvoidanceNetworks
from structlearn.avoidance.learned_models import (
    ALL,
    ENSEMBLE,
    HUMAN_INSPIRED,
    NETWORK,
    PHASE_MODULATED,
    SETTING,
    AvoidanceModels,
    train_phase_modulated,
)
from structlearn.avoidance.network_training import (
    AvoidanceNetworkParameters,
    EnsembleParameters,
    SplitParameters,
    fit_errors,
    fit_human_inspired_models,
    fit_networks,
    held_out_rows,
)
from structlearn.avoidance.rai_2014 import HumanInspiredModels
from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map
from structlearn.core.params import Parameters
from structlearn.feedback.trainers import TrainingParameters

KEYS = ["person", "model", "learned_from", "obstacle", "scenario"]
"""Columns of the error table that identify a model and the samples it is tested on."""


class AvoidanceTrainingParameters(Parameters):
    """Training of the avoidance models."""

    split: SplitParameters
    per_setting: AvoidanceNetworkParameters
    across_settings: AvoidanceNetworkParameters
    ensemble: EnsembleParameters
    phase_modulated: TrainingParameters
    phase_modulated_hidden: tuple[PositiveInt, ...]


Stack = TypeVar("Stack", AvoidanceNetworks, HumanInspiredModels)


class _TrainingSet(NamedTuple):
    """Training and test samples of one model."""

    person: int
    learned_from: str  # `SETTING`, a shape or `ALL`
    obstacle: str  # shape of the obstacles; empty if there are several
    setting: int  # from 1; 0 for all settings
    dataset: AvoidanceDataset
    test: np.ndarray  # (S,) mask of held-out samples


def learn_avoidance(
    datasets: Mapping[int, AvoidanceDataset],
    scenarios: Sequence[Scenario],
    parameters: AvoidanceTrainingParameters,
    modulated: int,
) -> tuple[dict[int, AvoidanceModels], pd.DataFrame]:
    """Train all models of all people, from datasets by person.

    Phase-modulated networks, on which no claim rests, are trained for the person `modulated` only.

    Returns models by person, and `network_training.fit_errors` by `KEYS`; models of all shapes have a row for
    each shape.

    Raises InputError: datasets of other scenarios, too few samples, a constant target.
    """
    own = own_scenarios(scenarios, list(datasets))
    sets: list[_TrainingSet] = []
    for person, dataset in datasets.items():
        test = held_out_rows(dataset, parameters.split)
        sets += _training_sets(person, dataset, test, scenarios, own[person])
    of_setting = [one for one in sets if one.learned_from == SETTING]
    of_shape = [one for one in sets if one.learned_from not in (SETTING, ALL)]
    across = [one for one in sets if one.learned_from != SETTING]
    across.sort(key=lambda one: -len(one.dataset))  # longest first, to balance the load
    steered = [*of_shape, *of_setting]
    modulating = [one for one in across if one.person == modulated]

    networks = fit_networks(_training(across), parameters.across_settings, "networks across settings")
    ensembles = fit_networks(_training(across), parameters.ensemble, "ensembles across settings")
    own_networks = fit_networks(_training(of_setting), parameters.per_setting, "networks per setting")
    human_inspired = fit_human_inspired_models(_training(steered), "human-inspired models")
    models: dict[int, AvoidanceModels] = {
        person: {
            NETWORK: _models(across, networks, person) | _models(of_setting, own_networks, person),
            ENSEMBLE: _models(across, ensembles, person),
            HUMAN_INSPIRED: _models(steered, human_inspired, person),
        }
        for person in datasets
    }
    training, hidden = parameters.phase_modulated, parameters.phase_modulated_hidden
    train = partial(train_phase_modulated, parameters=training, hidden=hidden)
    found = parallel_map(train, _training(modulating), "phase-modulated networks")
    sources = [one.learned_from for one in modulating]
    models[modulated] = {**models[modulated], PHASE_MODULATED: dict(zip(sources, found, strict=True))}
    return models, _errors(models, [one for one in sets if one.learned_from != ALL])


def _training_sets(
    person: int, dataset: AvoidanceDataset, test: np.ndarray, scenarios: Sequence[Scenario], own: np.ndarray
) -> Iterator[_TrainingSet]:
    """A person's training sets: each own scenario, all scenarios of each shape, and all scenarios."""
    if set(dataset.scenario) != set(range(len(scenarios))):
        raise InputError(f"the samples are not those of {len(scenarios)} scenarios; run all stages")

    def training_set(
        places: Sequence[int], learned_from: str, obstacle: str = "", setting: int = 0
    ) -> _TrainingSet:
        rows = np.isin(dataset.scenario, places)
        return _TrainingSet(person, learned_from, obstacle, setting, dataset.where(rows), test[rows])

    for place in own:
        yield training_set([place], SETTING, scenarios[place].shape, scenarios[place].setting)
    for shape in dict.fromkeys(scenario.shape for scenario in scenarios):
        its = [place for place, scenario in enumerate(scenarios) if scenario.shape == shape]
        yield training_set(its, shape, shape)
    yield training_set(range(len(scenarios)), ALL)


def _training(sets: Sequence[_TrainingSet]) -> list[AvoidanceDataset]:
    return [one.dataset.where(~one.test) for one in sets]


def _models(sets: Sequence[_TrainingSet], stack: Stack, person: int) -> dict[str, Stack]:
    """One person's models by source, from a stack with one model per training set."""
    sources = [one.learned_from if one.person == person else "" for one in sets]
    names = filter(None, dict.fromkeys(sources))
    return {name: stack.take([place for place, one in enumerate(sources) if one == name]) for name in names}


def _errors(models: Mapping[int, AvoidanceModels], sets: Sequence[_TrainingSet]) -> pd.DataFrame:
    """Errors on each set of all models whose training includes it."""
    rows = []
    for (person, source), same in groupby(sets, key=lambda one: (one.person, one.learned_from)):
        for place, one in enumerate(same):
            for kind, found in models[person].items():
                for name in (source, ALL) if source != SETTING else (source,):
                    if name in found:
                        model = found[SETTING].take([place]) if source == SETTING else found[name]
                        values = (person, kind, name, one.obstacle, one.setting)
                        key = dict(zip(KEYS, values, strict=True))
                        rows += [key | row for row in fit_errors(one.dataset, one.test, model)]
    return pd.DataFrame(rows)
