"""All avoidance models of the testbed, and how well they fit (tables IV.1 and IV.2, figure IV.10).

Every model learns from the same demonstrations and is tested on the same others, whether it learns one
scenario, all of one shape, or all there are.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from structlearn.avoidance.avoidance_dataset import AvoidanceDataset
from structlearn.avoidance.features import CouplingModel
from structlearn.avoidance.learned_models import ALL, SETTING, AvoidanceModels
from structlearn.avoidance.network_training import (
    by_scenario,
    fit_errors,
    fit_human_inspired_models,
    fit_networks,
    held_out_rows,
)
from structlearn.avoidance.phase_modulated import PhaseModulatedAvoidance
from structlearn.avoidance.phase_modulated_training import train_phase_modulated
from structlearn.ground.errors import InputError
from structlearn.ground.parallel import parallel_map
from structlearn.testbeds.obstacles.protocol.fit_parameters import AvoidanceTrainingParameters
from structlearn.testbeds.obstacles.world.scenarios import Scenario


@dataclass(frozen=True)
class _Lessons:
    """Datasets that a model each is learned from, and what the table of errors says of them.

    Attributes:
        datasets: all samples.
        tests: (S,) mask of the samples of each that test.
        keys: columns `obstacle` and `scenario` of each.
    """

    datasets: Sequence[AvoidanceDataset]
    tests: Sequence[np.ndarray]
    keys: pd.DataFrame

    @property
    def training(self) -> list[AvoidanceDataset]:
        return [one.where(~mask) for one, mask in zip(self.datasets, self.tests, strict=True)]

    def errors(
        self, models: Sequence[CouplingModel], model: str, learned_from: Sequence[str]
    ) -> pd.DataFrame:
        found = fit_errors(self.datasets, self.tests, models)
        place = found.pop("model").to_numpy()
        keys = self.keys.iloc[place].reset_index(drop=True)
        source = np.array(learned_from, dtype=object)[place]
        return pd.concat([keys.assign(model=model, learned_from=source), found], axis=1)


def learn(
    dataset: AvoidanceDataset, scenarios: Sequence[Scenario], parameters: AvoidanceTrainingParameters
) -> tuple[AvoidanceModels, pd.DataFrame]:
    """Train every model.

    Args:
        dataset: samples of all demonstrations.
        scenarios: by their numbers in the dataset.
        parameters: see there.

    Returns:
        The models, and the columns of `models.fit_errors` per `model`, what it was `learned_from`, the
        `obstacle` whose samples the errors are of, its `scenario` (number of the setting; 0 for all of them)
        and `part`. The network of all shapes has a row for each.

    Raises:
        InputError: scenarios and dataset do not belong together; too few samples; a constant target.
    """
    if set(dataset.scenario) != set(range(len(scenarios))):
        raise InputError(f"the samples are not those of {len(scenarios)} scenarios; run all stages")
    test = held_out_rows(dataset, parameters.split)
    settings, shapes = _per_setting(dataset, test, scenarios), _per_shape(dataset, test, scenarios)
    names = list(shapes.keys["obstacle"])
    everything = [dataset.where(~test)]

    # the longest first
    of_all = fit_networks(everything, parameters.all_shapes, "network of all shapes")
    of_shapes = fit_networks(shapes.training, parameters.per_shape, "networks per shape")
    of_settings = fit_networks(settings.training, parameters.per_setting, "networks per setting")
    steered = fit_human_inspired_models([*shapes.training, *settings.training], "human-inspired models")
    work = [(one, parameters) for one in (*everything, *shapes.training)]
    modulated = parallel_map(_phase_modulated, work, "phase-modulated networks")

    places = range(len(names))
    models = AvoidanceModels(
        networks={SETTING: of_settings, ALL: of_all}
        | {name: of_shapes.take([place]) for name, place in zip(names, places, strict=True)},
        human_inspired={SETTING: steered.take(np.arange(len(names), len(steered)))}
        | {name: steered.take([place]) for name, place in zip(names, places, strict=True)},
        phase_modulated=dict(zip([ALL, *names], modulated, strict=True)),
    )
    return models, _errors(models, settings, shapes)


def _errors(models: AvoidanceModels, settings: _Lessons, shapes: _Lessons) -> pd.DataFrame:
    names = list(shapes.keys["obstacle"])
    tables = []
    for kind, found in models.kinds.items():
        if SETTING in found:
            each = [found[SETTING].take([place]) for place in range(len(settings.datasets))]
            tables.append(settings.errors(each, kind, [SETTING] * len(each)))
        tables.append(shapes.errors([found[name] for name in names], kind, names))
        if ALL in found:
            tables.append(shapes.errors([found[ALL]] * len(names), kind, [ALL] * len(names)))
    return pd.concat(tables, ignore_index=True)


def _per_setting(dataset: AvoidanceDataset, test: np.ndarray, scenarios: Sequence[Scenario]) -> _Lessons:
    keys = pd.DataFrame(
        {
            "obstacle": [scenario.shape for scenario in scenarios],
            "scenario": [scenario.setting for scenario in scenarios],
        }
    )
    tests = [test[dataset.scenario == place] for place in range(len(scenarios))]
    return _Lessons(by_scenario(dataset), tests, keys)


def _per_shape(dataset: AvoidanceDataset, test: np.ndarray, scenarios: Sequence[Scenario]) -> _Lessons:
    shapes = np.array([scenario.shape for scenario in scenarios])
    names = list(dict.fromkeys(shapes.tolist()))
    masks = [shapes[dataset.scenario] == name for name in names]
    keys = pd.DataFrame({"obstacle": names, "scenario": 0})
    return _Lessons([dataset.where(mask) for mask in masks], [test[mask] for mask in masks], keys)


def _phase_modulated(work: tuple[AvoidanceDataset, AvoidanceTrainingParameters]) -> PhaseModulatedAvoidance:
    dataset, parameters = work
    return train_phase_modulated(dataset, parameters.phase_modulated, parameters.phase_modulated_hidden)
