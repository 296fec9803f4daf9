"""Feedback from your own corrections, and how well it predicts those that it was not learned from (IV.6)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from structlearn.core.artefacts import publish, read_table, write_table
from structlearn.core.errors import InputError
from structlearn.core.metrics import nmse
from structlearn.core.parallel import parallel_map
from structlearn.feedback.coupling import AXES, Axis
from structlearn.feedback.coupling_dataset import CouplingDataset, from_axes_table, to_axes_table
from structlearn.feedback.coupling_model import CouplingModel, read_networks, train_final, write_networks
from structlearn.feedback.coupling_targets import coupling_dataset, learn_expected, require_parts
from structlearn.primitives.primitive_files import read_vector_primitive, write_vector_primitive
from structlearn.primitives.sequence import PosePrimitive
from structlearn.primitives.vector import VectorPrimitive
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.segments import execution_cuts
from structlearn.tasks.task_entry import OwnFeedbackParameters
from structlearn.tasks.task_files import ABSENT

NETWORKS = "networks.safetensors"


@dataclass(frozen=True)
class OwnFeedback:
    """What was learned of P primitives with feedback.

    Attributes:
        expected: traces by primitive.
        datasets: samples of all settings by primitive and axis.
        networks: by primitive and axis.
        checks: of `coupling_targets.coupling_dataset`, with `primitive`; `setting` is a label.
        scores: `primitive`, `axis`, `left_out`, `learned` (False: a setting that is only there to test) and
            `nmse` on what was left out.
    """

    expected: Mapping[str, VectorPrimitive]
    datasets: Mapping[str, Mapping[Axis, CouplingDataset]]
    networks: Mapping[str, Mapping[Axis, CouplingModel]]
    checks: pd.DataFrame
    scores: pd.DataFrame


def learn_own_feedback(
    executions: Sequence[Demonstration],
    corrections: Mapping[str, Sequence[Demonstration]],
    primitives: Sequence[PosePrimitive],
    cutting: SegmentParameters,
    parameters: OwnFeedbackParameters,
) -> OwnFeedback:
    """Expected traces from executions, coupling targets from corrections, and networks between them.

    Raises:
        InputError: a run cannot be cut or lacks a stream, a primitive is not there, or samples are too few.
    """
    names = [primitive.name for primitive in primitives]
    traces = learn_expected(
        executions, execution_cuts(executions, names, cutting), parameters.expected_hz, parameters.sensors
    )
    require_parts(parameters.primitives, primitives, traces)
    cuts = {label: execution_cuts(runs, names, cutting) for label, runs in corrections.items()}
    datasets, checks = {}, []
    for name in parameters.primitives:
        own = {label: parts[name] for label, parts in cuts.items()}
        primitive = primitives[names.index(name)]
        datasets[name], found = coupling_dataset(corrections, own, primitive, traces[name], parameters)
        checks.append(found.assign(primitive=name))
    networks, scores = _learned(datasets, parameters)
    return OwnFeedback(traces, datasets, networks, pd.concat(checks, ignore_index=True), scores)


def _learned(
    datasets: Mapping[str, Mapping[Axis, CouplingDataset]], parameters: OwnFeedbackParameters
) -> tuple[dict[str, dict[Axis, CouplingModel]], pd.DataFrame]:
    """Final networks, and scores of those that were learned without a part."""
    work = []
    for name, by_axis in datasets.items():
        for axis, dataset in by_axis.items():
            seen = dataset.where(np.isin(dataset.setting, parameters.settings))
            work.append((name, axis, "", seen, parameters))
            work += [
                (name, axis, label, seen.where(group != label), parameters)
                for group in [_groups(seen, parameters)]
                for label in dict.fromkeys(group)
            ]
    trained = parallel_map(_trained, work, "training feedback")
    networks: dict[str, dict[Axis, CouplingModel]] = {name: {} for name in datasets}
    rows = []
    for (name, axis, label, _, _), network in zip(work, trained, strict=True):
        dataset = datasets[name][axis]
        learned = np.isin(dataset.setting, parameters.settings)
        if label:
            seen = dataset.where(learned)
            tests = {label: seen.where(_groups(seen, parameters) == label)}
        else:
            networks[name][axis] = network
            others = dict.fromkeys(dataset.setting[~learned])
            tests = {one: dataset.where(dataset.setting == one) for one in others}
        rows += [(name, axis, one, bool(label), _nmse(network, its)) for one, its in tests.items()]
    return networks, pd.DataFrame(rows, columns=["primitive", "axis", "left_out", "learned", "nmse"])


def _groups(dataset: CouplingDataset, parameters: OwnFeedbackParameters) -> np.ndarray:
    """Labels (S,) of what is left out in turn: settings, or parts of the demonstrations of a single one."""
    if len(parameters.settings) > 1:
        return dataset.setting.astype(str)
    parts = dataset.demonstration % parameters.parts
    if len(np.unique(parts)) < 2:
        raise InputError("feedback.corrections: of one setting at least two demonstrations are needed")
    return np.array([f"part {part + 1}" for part in parts])


def _trained(work: tuple[str, Axis, str, CouplingDataset, OwnFeedbackParameters]) -> CouplingModel:
    *_, dataset, parameters = work
    return train_final(parameters.model, dataset, parameters.training, parameters.hidden)


def _nmse(network: CouplingModel, dataset: CouplingDataset) -> float:
    return float(
        nmse(network.coupling(dataset.deviation, dataset.phase, dataset.phase_velocity), dataset.target)
    )


def write_own_feedback(feedback: OwnFeedback, target: str | Path) -> None:
    """Publish it as a folder."""
    with publish(target) as folder:
        folder.mkdir()
        for name, traces in feedback.expected.items():
            path = folder / f"expected/{name}.safetensors"
            write_vector_primitive(traces, path, "readings without offset")
        for name, by_axis in feedback.datasets.items():
            write_table(to_axes_table(by_axis), folder / f"datasets/{name}.parquet")
        networks = {
            f"{name}.{axis}": network
            for name, by_axis in feedback.networks.items()
            for axis, network in by_axis.items()
        }
        write_networks(list(networks.items()), folder / NETWORKS)
        write_table(feedback.checks, folder / "checks.parquet")
        write_table(feedback.scores, folder / "scores.parquet")


def read_own_feedback(source: str | Path) -> OwnFeedback | None:
    """What `write_own_feedback` left; None where the task has no feedback.

    Raises:
        InputError: a file is missing or damaged.
    """
    folder = Path(source)
    if (folder / ABSENT).exists():
        return None
    networks: dict[str, dict[Axis, CouplingModel]] = {}
    for key, network in read_networks(folder / NETWORKS).items():
        name, _, axis = key.rpartition(".")
        networks.setdefault(name, {})[AXES[AXES.index(axis)]] = network
    traces = sorted((folder / "expected").glob("*.safetensors"))
    tables = {name: read_table(folder / f"datasets/{name}.parquet") for name in networks}
    return OwnFeedback(
        expected={path.stem: read_vector_primitive(path) for path in traces},
        datasets={name: from_axes_table(table) for name, table in tables.items()},
        networks=networks,
        checks=read_table(folder / "checks.parquet"),
        scores=read_table(folder / "scores.parquet"),
    )
