"""Where the files of the recorded data lie, and what they hold, for all who read them."""

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from structlearn.feedback.pmnn import PhaseModulatedNetwork, read_networks
from structlearn.ground.artefacts import read_table
from structlearn.primitives.primitive_files import read_primitives, read_vector_primitive
from structlearn.primitives.sequence import PosePrimitive
from structlearn.primitives.vector import VectorPrimitive
from structlearn.recordings import read_demonstrations
from structlearn.recordings.demonstration import Demonstration

REACHES, HIGHER_REACHES, UNSCREWING, SCRAPING, SLIDES = (
    "reaches",
    "corrected_reaches",
    "unscrewing",
    "scraping",
    "slides",
)
"""Sets of movements."""

PRIMITIVES = {REACHES: "primitive", UNSCREWING: "primitive", SCRAPING: "primitives"}
"""File of the primitives learned from a set."""

TABLES = {
    "reach_errors": "reaches/reproduction",
    "cut_errors": "reaches/cut_errors",
    "coupling_distances": "corrected_reaches/distances",
    "coupling_profile": "corrected_reaches/profile",
    "coupling_scores": "corrected_reaches/scores",
    "coupling_targets": "corrected_reaches/targets",
    "coupling_paths": "corrected_reaches/paths",
    "unscrewing_errors": "unscrewing/errors",
    "sequence": "scraping/sequence",
    "sequence_errors": "scraping/errors",
    "electrode_scores": "scraping/electrode_scores",
    "electrode_traces": "scraping/electrode_traces",
    "clock_errors": "slides/clock_errors",
    "slide_deviations": "slides/deviations",
    "slide_left_one_out": "slides/left_one_out",
    "slide_statistics": "slides/statistics",
    "avoidance_scores": "avoidance/scores",
    "avoidance_folds": "avoidance/folds",
    "avoidance_phase": "avoidance/phase_worth",
    "touch_errors": "latent_touch/errors",
    "touch_sets": "latent_touch/sets",
    "touch_likeness": "latent_touch/likeness",
    "touch_correlations": "latent_touch/correlations",
    "panda_errors": "dynamics/errors",
    "panda_friction": "dynamics/friction",
    "panda_links": "dynamics/links",
    "panda_traces": "dynamics/traces",
    "slide_torques": "dynamics/slide_torques",
    "slide_payloads": "dynamics/slide_payloads",
}
"""Tables that a page shows, by name."""

CALIBRATION = ("comparison", "electrodes", "fingers", "spectra", "components", "traces")
"""Tables of simulated touch beside recorded touch."""

SKIN = ("errors", "maps", "servo", "paths", "force", "lags", "traces")
"""Tables of the magnetic skin; none where it was not imported."""


def shown_map(maps: pd.DataFrame, tuned_on: Collection[str]) -> pd.DataFrame:
    """The map of the skin that is shown: the first that asks about a run that nothing was tuned on."""
    untouched = maps[~maps["asked_about"].isin(tuned_on)]
    maps = untouched if len(untouched) else maps
    first = maps[["learned_from", "asked_about"]].iloc[0]
    return maps[(maps["learned_from"] == first.iloc[0]) & (maps["asked_about"] == first.iloc[1])]


@dataclass(frozen=True)
class RecordedFiles:
    """What the stages wrote, read.

    Attributes:
        data: folder of all data.
    """

    data: Path = Path("data")

    def demonstrations(self, name: str, **clock: float) -> list[Demonstration]:
        """A set of movements; `clock` as for `recordings.read_demonstrations`."""
        return read_demonstrations(self.data / "raw/recorded" / name, **clock)

    def tables(self) -> dict[str, pd.DataFrame]:
        """All of `TABLES`."""
        return {name: self._table(path) for name, path in TABLES.items()}

    def calibration(self) -> dict[str, pd.DataFrame]:
        """All of `CALIBRATION`."""
        return {name: self._table(f"calibration/{name}") for name in CALIBRATION}

    def skin(self) -> dict[str, pd.DataFrame]:
        """Those of `SKIN` that are there."""
        there = [name for name in SKIN if (self.data / f"recorded/skin/{name}.parquet").exists()]
        return {name: self._table(f"skin/{name}") for name in there}

    def sequence(self) -> pd.DataFrame:
        """The unrolled scraping sequence, as `primitives.sequence.sequence_table` has it."""
        return self._table(TABLES["sequence"])

    def primitives(self, name: str) -> list[PosePrimitive]:
        """Primitives in their order that were learned from a set."""
        return read_primitives(self.data / f"recorded/{name}/{PRIMITIVES[name]}.safetensors")

    def coupling_networks(self) -> dict[str, PhaseModulatedNetwork]:
        """Per local axis, learned from higher reaches."""
        return read_networks(self.data / "recorded/corrected_reaches/networks.safetensors")

    def expected_slide(self) -> VectorPrimitive:
        """Expected traces of the electrodes on the material that was learned."""
        return read_vector_primitive(self.data / "recorded/slides/expected.safetensors")

    def _table(self, path: str) -> pd.DataFrame:
        return read_table(self.data / f"recorded/{path}.parquet")
