"""Outputs of the scraping testbed's stages for the person that its pages show."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from dissertation.scraping import files
from dissertation.scraping.names import CORRECTED
from dissertation.scraping.protocol.execution_scores import AFTER, BEFORE, NOMINAL
from dissertation.scraping.protocol.feedback_models import POINTWISE
from dissertation.scraping.world.testbed import FINGERS
from structlearn.core import signals
from structlearn.core.artefacts import read_table
from structlearn.feedback.coupling_dataset import CouplingDataset
from structlearn.feedback.coupling_model import CouplingModel, read_networks
from structlearn.primitives import vector
from structlearn.primitives.fitting import Segment, segment_paths
from structlearn.primitives.primitive_files import read_primitives
from structlearn.primitives.sequence import PosePrimitive
from structlearn.primitives.vector import VectorPrimitive
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.alignment import RESULT
from structlearn.segmentation.parameters import PrimitiveParameters
from structlearn.segmentation.segments import Segmentation, commanded_cuts, read_segmentation
from structlearn.tactile.electrodes import ELECTRODES_MM

SAMPLES = 101  # samples over normalised time of curves that are compared


@dataclass(frozen=True)
class Stored:
    """Outputs of the stages, and selections from them that pages and figures share."""

    parameters: Mapping[str, Any]  # keyed as in `params.yaml`
    tables: Mapping[str, pd.DataFrame]  # `files.TABLES`, and `checks` of the supervised data
    demonstrations: Sequence[Demonstration]  # complete ones, including those that could not be cut
    segmentation: Segmentation  # of the demonstrations
    primitives: Sequence[PosePrimitive]  # learned from all demonstrations that were cut
    unrolls: Sequence[Demonstration]  # nominal executions in the default setting
    expected: Mapping[str, VectorPrimitive]  # expected traces by primitive
    datasets: Mapping[str, CouplingDataset]  # all settings, by primitive
    networks: Mapping[str, CouplingModel]  # pointwise models by primitive
    tilted: Mapping[str, Sequence[Demonstration]]  # runs at `tilt_deg` by model, and `CORRECTED`
    refined: Mapping[str, Sequence[Demonstration]]  # runs at `refined_deg` by model

    @property
    def names(self) -> list[str]:
        """Names of all primitives, in temporal order."""
        return [one.name for one in self.primitives]

    @property
    def adapted(self) -> list[str]:
        """Primitives with feedback, in temporal order."""
        return [name for name in self.names if name in self.datasets]

    @property
    def axis(self) -> np.ndarray:
        """Roll axis (3,), unit vector."""
        return self.parameters["coupling_dataset"].unit_axis

    @property
    def tilt_deg(self) -> float:
        """Largest roll of the board in executions, shown in detail."""
        return max(self.parameters["evaluate_feedback"].settings_deg)

    @property
    def refined_deg(self) -> float:
        """Roll of the board at which models were refined."""
        return self.parameters["refine"].setting_deg

    @property
    def found_primitives(self) -> list[PrimitiveParameters]:
        """Primitives with an axis, which have their own cut points."""
        return [one for one in self.parameters["segment"].primitives if one.axis != "between"]

    @cached_property
    def was_cut(self) -> list[Demonstration]:
        """Demonstrations that could be cut."""
        names = set(self.segmentation.cuts["demonstration"])
        return [one for one in self.demonstrations if one.name in names]

    @cached_property
    def reference(self) -> Demonstration:
        """Demonstration that the others are aligned with."""
        return next(one for one in self.was_cut if one.name == self.segmentation.reference)

    @cached_property
    def guesses(self) -> list[Demonstration]:
        """Demonstrations aligned with the reference; the first is shown in detail."""
        return [one for one in self.was_cut if one is not self.reference]

    def most_refined_guess(self, primitive: str) -> Demonstration:
        """Guess for which ordinary and weighted least squares find the most different cut points."""
        ordinary, weighted = (
            self.segmentation.result(primitive, method)[["start_s", "end_s"]] for method in ("ls", RESULT)
        )
        difference = (ordinary - weighted).abs().sum(axis=1)
        return max(self.guesses, key=lambda guess: difference[guess.name])

    @property
    def sequences(self) -> dict[str, pd.DataFrame]:
        """Both sequences, keyed as in figures and claims."""
        return {"as demonstrated": self.tables["nominal"], "new situation": self.tables["generalised"]}

    @cached_property
    def segments(self) -> dict[str, list[Segment]]:
        """Segments from which each primitive was learned."""
        cuts, cutoff = self.segmentation.results, self.parameters["fit_primitives"].smoothing_hz
        return {name: segment_paths(self.was_cut, cuts[name], cutoff) for name in cuts}

    @cached_property
    def corrected_deg(self) -> list[float]:
        """Settings with corrections, ascending."""
        return np.unique(np.concatenate([one.setting for one in self.datasets.values()])).tolist()

    @property
    def demonstrations_per_setting(self) -> int:
        """Largest number of corrected demonstrations in a setting."""
        return max(len(np.unique(one.demonstration)) for one in self.datasets.values())

    @cached_property
    def channels(self) -> dict[str, tuple[int, float]]:
        """`informative_channel` by primitive: channel, and its correlation with the tilt."""
        return {name: informative_channel(self.datasets[name]) for name in self.adapted}

    @cached_property
    def felt(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Executed (R, T, E) and expected (T, E) counts over normalised time, by primitive."""
        cuts, found = commanded_cuts(self.unrolls, self.names), {}
        for name in self.names:
            runs = []
            for run in self.unrolls:
                first, last = (round(float(end) / run.dt) for end in cuts[name].loc[run.name])
                part = vector.without_offset(run.signal("tactile"))[first : last + 1]
                runs.append(signals.time_normalised(part, SAMPLES))
            learned = self.expected[name]
            shown = vector.expected_traces(learned, SAMPLES, learned.duration / (SAMPLES - 1))
            found[name] = np.stack(runs), shown
        return found

    @property
    def expected_errors(self) -> tuple[float, float]:
        """Overall rms in counts of the expected trace's error against the mean run, and of the runs' std."""
        off = [np.mean((runs.mean(axis=0) - learned) ** 2) for runs, learned in self.felt.values()]
        spread = [
            np.mean(runs.var(axis=0, ddof=1)) if len(runs) > 1 else np.nan for runs, _ in self.felt.values()
        ]
        return float(np.sqrt(np.mean(off))), float(np.sqrt(np.mean(spread)))


def channel_name(channel: int) -> str:
    """Channel, finger and electrode as text, from the channel's index."""
    finger, electrode = divmod(channel, len(ELECTRODES_MM))
    return f"channel {channel + 1} ({FINGERS[finger]} finger, electrode {electrode + 1})"


def informative_channel(dataset: CouplingDataset) -> tuple[int, float]:
    """Channel whose mean deviation per demonstration correlates most with the setting, and how much."""
    means = pd.DataFrame(dataset.deviation).groupby([dataset.setting, dataset.demonstration]).mean()
    setting = pd.Series(means.index.get_level_values(0).to_numpy(float), means.index)
    correlation = means.corrwith(setting).fillna(0.0)  # NaN for constant channels
    channel = int(np.argmax(correlation.abs()))
    return channel, float(correlation[channel])


def read_stored(found: files.ScrapingFiles, parameters: Mapping[str, Any]) -> Stored:
    """Read the outputs of the stages and of the study."""
    folder = found.data / "feedback/scraping"
    primitives = read_primitives(found.data / "primitives/scraping/primitives.safetensors")
    datasets = files.read_datasets(folder / "dataset")
    checks = [
        read_table(folder / f"dataset/{files.CHECKS}{one.name}.parquet").assign(primitive=one.name)
        for one in primitives
        if one.name in datasets
    ]
    tables = {name: found.table(name) for name in files.TABLES if name not in UNUSED}
    largest, tilt = max(parameters["evaluate_feedback"].settings_deg), parameters["refine"].setting_deg
    tilted = {model: found.runs_at(largest, files.CLOSED_LOOP, model) for model in (NOMINAL, POINTWISE)}
    refined = {model: found.runs_at(tilt, files.REFINED, model) for model in (NOMINAL, BEFORE, AFTER)}
    return Stored(
        parameters=parameters,
        tables=tables | {"checks": pd.concat(checks, ignore_index=True)},
        demonstrations=found.runs("nominal"),
        segmentation=read_segmentation(found.data / "segments/scraping"),
        primitives=primitives,
        unrolls=found.runs("unrolls"),
        expected=files.read_expected(folder / "expected"),
        datasets=datasets,
        networks=read_networks(folder / f"models/{POINTWISE}.safetensors"),
        tilted=tilted | {CORRECTED: found.runs_at(largest, files.CORRECTIONS)},
        refined={model: runs for model, runs in refined.items() if runs},
    )


UNUSED = ("rollouts", "refined_traces")
"""Large tables that only the recordings use."""
