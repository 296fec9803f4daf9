"""Feedback learned from corrections in several settings, and its errors on those left out (IV.6)."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from structlearn.core.artefacts import Metrics, read_table, write_table
from structlearn.core.errors import InputError
from structlearn.core.metrics import nmse
from structlearn.core.parallel import parallel_map
from structlearn.feedback.corrected_paths import SAMPLES, corrected_paths
from structlearn.feedback.coupling import AXES, Axis, turns
from structlearn.feedback.coupling_dataset import (
    CouplingDataset,
    concatenated,
    from_axes_table,
    to_axes_table,
)
from structlearn.feedback.coupling_model import CouplingModel, read_networks, write_networks
from structlearn.feedback.coupling_targets import (
    coupling_dataset,
    learn_expected,
    level_dataset,
    require_parts,
)
from structlearn.feedback.trainers import train_final
from structlearn.primitives.fitting import in_phase
from structlearn.primitives.primitive_files import read_vector_primitive, write_vector_primitive
from structlearn.primitives.sequence import PosePrimitive
from structlearn.primitives.vector import VectorPrimitive
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.segments import execution_cuts
from structlearn.tasks.movement.parameters import TaskFeedbackParameters

NETWORKS = "networks.safetensors"

# Setting of the nominal executions, which are not corrected: their coupling target is 0
LEVEL = "no correction"


@dataclass(frozen=True)
class LearnedFeedback:
    """Feedback learned for P primitives, by primitive and axis."""

    expected: Mapping[str, VectorPrimitive]  # expected traces by primitive
    datasets: Mapping[str, Mapping[Axis, CouplingDataset]]  # corrections in all settings
    networks: Mapping[str, Mapping[Axis, CouplingModel]]
    checks: pd.DataFrame  # of `coupling_targets.coupling_dataset`, with `primitive`; `setting` is a label
    # `primitive`, `axis`, `left_out`, `learned` (False: a test-only setting), `nmse` on what was left out
    # (NaN if nothing was corrected); for the unroll with recorded readings, the displacement `target` at the
    # peak of its mean, the one `predicted` there, and the rms difference `rms` (m, rad)
    scores: pd.DataFrame


def learn_feedback(
    executions: Sequence[Demonstration],
    corrections: Mapping[str, Sequence[Demonstration]],
    primitives: Sequence[PosePrimitive],
    cutting: SegmentParameters,
    parameters: TaskFeedbackParameters,
) -> LearnedFeedback:
    """Learn expected traces from executions, coupling targets from corrections, and networks between them.

    Executions are training data too, with target 0: as-expected readings need no correction. Raises
    InputError: a run cannot be cut or lacks a stream, a primitive is missing, or there are too few samples.
    """
    names = [primitive.name for primitive in primitives]

    def cuts_of(runs: Sequence[Demonstration]) -> dict[str, pd.DataFrame]:
        found = execution_cuts(runs, names, cutting)
        return {one.name: in_phase(runs, found[one.name], one, parameters.smoothing_hz) for one in primitives}

    nominal = cuts_of(executions)
    traces = learn_expected(executions, nominal, parameters.expected_hz, parameters.sensors)
    require_parts(parameters.primitives, primitives, traces)
    cuts = {label: cuts_of(runs) for label, runs in corrections.items()}
    datasets, levels, checks = {}, {}, []
    for name in parameters.primitives:
        own = {label: parts[name] for label, parts in cuts.items()}
        primitive = primitives[names.index(name)]
        datasets[name], check = coupling_dataset(corrections, own, primitive, traces[name], parameters)
        levels[name] = level_dataset(executions, nominal[name], traces[name], parameters, LEVEL)
        checks.append(check.assign(primitive=name))
    networks, scores = _learned(datasets, levels, parameters)
    return LearnedFeedback(traces, datasets, networks, pd.concat(checks, ignore_index=True), scores)


def _learned(
    datasets: Mapping[str, Mapping[Axis, CouplingDataset]],
    levels: Mapping[str, CouplingDataset],
    parameters: TaskFeedbackParameters,
) -> tuple[dict[str, dict[Axis, CouplingModel]], pd.DataFrame]:
    """Final networks, and scores of networks trained without one part and every other execution."""
    work = list[_Training]()
    for name, by_axis in datasets.items():
        for axis, dataset in by_axis.items():
            whole = _Training(name, axis, "", dataset, levels[name], parameters)
            parts = dict.fromkeys(_groups(whole.seen, parameters))
            work += [whole, *(replace(whole, left_out=label) for label in parts)]
    networks: dict[str, dict[Axis, CouplingModel]] = {name: {} for name in datasets}
    rows = []
    for training, network in zip(work, parallel_map(_trained, work, "training feedback"), strict=True):
        name, axis, label = training.name, training.axis, training.left_out
        if not label:
            networks[name][axis] = network
        for setting, samples in training.tests():
            if len(samples.target):
                rows.append((name, axis, setting, bool(label), *_scored(network, samples)))
    keys = ["primitive", "axis", "left_out", "learned"]
    scores = pd.DataFrame(rows, columns=[*keys, "nmse", "target", "predicted", "rms"])
    return networks, scores.groupby(keys, sort=False).mean().reset_index()


@dataclass(frozen=True)
class _Training:
    """Training of one network; the samples it is trained and tested on are selected only when needed."""

    name: str
    axis: Axis
    left_out: str  # setting or part left out; empty: none, and the network is the final one
    dataset: CouplingDataset
    level: CouplingDataset
    parameters: TaskFeedbackParameters

    @property
    def seen(self) -> CouplingDataset:
        """Samples of the settings that are learned from."""
        return self.dataset.where(np.isin(self.dataset.setting, self.parameters.settings))

    def samples(self) -> CouplingDataset:
        """Samples to train on: without what is left out, and then with every other execution only."""
        if not self.left_out:
            return concatenated([self.seen, self.level])
        seen, odd = self.seen, self.level.demonstration % 2 == 1
        kept = seen.where(_groups(seen, self.parameters) != self.left_out)
        return concatenated([kept, self.level.where(~odd)])

    def tests(self) -> Iterator[tuple[str, CouplingDataset]]:
        """Samples to test on, by setting or part: settings only tested, or what was left out."""
        if not self.left_out:
            settings = self.dataset.setting
            for other in dict.fromkeys(settings[~np.isin(settings, self.parameters.settings)]):
                yield other, self.dataset.where(settings == other)
            return
        seen = self.seen
        yield self.left_out, seen.where(_groups(seen, self.parameters) == self.left_out)
        yield LEVEL, self.level.where(self.level.demonstration % 2 == 1)


def _groups(dataset: CouplingDataset, parameters: TaskFeedbackParameters) -> np.ndarray:
    """Labels (S,) of the parts left out in turn: settings, or groups of demonstrations of one setting."""
    if len(parameters.settings) > 1:
        return dataset.setting.astype(str)
    parts = dataset.demonstration % parameters.parts
    if len(np.unique(parts)) < 2:
        raise InputError("feedback.corrections: of one setting at least two demonstrations are needed")
    return np.array([f"part {part + 1}" for part in parts])


def _trained(training: _Training) -> CouplingModel:
    parameters = training.parameters
    return train_final(parameters.network, training.samples(), parameters.training, parameters.hidden)


def _scored(network: CouplingModel, dataset: CouplingDataset) -> tuple[float, float, float, float]:
    """NMSE of the coupling terms; and for the unroll, demanded and predicted displacement, rms difference."""
    corrected = np.ptp(dataset.target) > 0.0
    error = nmse(network.coupling(dataset.deviation, dataset.phase, dataset.phase_velocity), dataset.target)
    paths = corrected_paths(dataset, SAMPLES)
    predicted = paths.displacement(network)
    target, mean = paths.correction.mean(axis=0), predicted.mean(axis=0)
    peak = int(np.argmax(np.abs(target if corrected else mean)))
    rms = float(np.sqrt(np.mean((predicted - paths.correction) ** 2)))
    return (float(error) if corrected else np.nan), float(target[peak]), float(mean[peak]), rms


def feedback_metrics(feedback: LearnedFeedback) -> Metrics:
    """NMSE on what was left out, and displacement commanded without correction, in mm or degrees."""
    metrics: Metrics = {}
    for (name, axis), scores in feedback.scores.groupby(["primitive", "axis"], sort=False):
        metrics[f"feedback_{name}_{axis}_nmse"] = float(scores.loc[scores["learned"], "nmse"].mean())
        for predicted in scores.loc[scores["left_out"] == LEVEL, "predicted"]:
            factor, unit = in_view(axis)
            metrics[f"feedback_{name}_{axis}_uncorrected_{unit}"] = factor * abs(float(predicted))
    return metrics


def in_view(axis: Axis) -> tuple[float, str]:
    """Factor and unit for displaying displacements along or about an axis."""
    return (float(np.degrees(1.0)), "deg") if turns(axis) else (1e3, "mm")


def write_feedback(feedback: LearnedFeedback, folder: Path) -> None:
    """Write feedback to a folder."""
    networks = []
    for name, traces in feedback.expected.items():
        write_vector_primitive(traces, folder / f"expected/{name}.safetensors", "readings without offset")
    for name, by_axis in feedback.datasets.items():
        write_table(to_axes_table(by_axis), folder / f"datasets/{name}.parquet")
        networks += [(f"{name}.{axis}", network) for axis, network in feedback.networks[name].items()]
    write_networks(networks, folder / NETWORKS)
    write_table(feedback.checks, folder / "checks.parquet")
    write_table(feedback.scores, folder / "scores.parquet")


def read_feedback(folder: Path) -> LearnedFeedback | None:
    """Read what `write_feedback` wrote; None if the task has no feedback from sensors."""
    if not (folder / NETWORKS).exists():
        return None
    networks: dict[str, dict[Axis, CouplingModel]] = {}
    for key, network in read_networks(folder / NETWORKS).items():
        name, _, axis = key.rpartition(".")
        networks.setdefault(name, {})[AXES[AXES.index(axis)]] = network
    traces = sorted((folder / "expected").glob("*.safetensors"))
    return LearnedFeedback(
        {path.stem: read_vector_primitive(path) for path in traces},
        {name: from_axes_table(read_table(folder / f"datasets/{name}.parquet")) for name in networks},
        networks,
        read_table(folder / "checks.parquet"),
        read_table(folder / "scores.parquet"),
    )
