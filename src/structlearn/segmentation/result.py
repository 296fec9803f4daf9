"""The result of a segmentation, in memory and on disk."""

from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from structlearn.ground.artefacts import publish, read_table, write_table
from structlearn.ground.errors import InputError

METHODS = ("zvc", "dtw", "ls", "wls_text", "wls")
RESULT = "wls"
"""The method whose cuts are used; the others are kept to be compared."""

AS_PRINTED = "wls_text"
"""The dissertation's."""


@dataclass(frozen=True)
class Segmentation:
    """All cuts of a set of demonstrations."""

    # one row per demonstration, primitive and method: `demonstration`, `primitive`, `method`, `start_s`,
    # `end_s` (since the start of the demonstration)
    cuts: pd.DataFrame
    # one row per correspondence: `demonstration`, `primitive`, `reference_s`, `guess_s` (since the start of
    # either demonstration), `weight`
    pairs: pd.DataFrame
    left_out: pd.DataFrame  # `demonstration`, `reason` of those that could not be cut
    # `demonstration`, `primitive`, `reason`, `number` of what speaks against a cut (`doubts`)
    doubts: pd.DataFrame
    reference: str  # name of the reference demonstration
    cells: int = 0  # of all warping tables that were computed; not kept on disk

    @property
    def primitives(self) -> list[str]:
        """Names of the primitives in order of time."""
        return list(self.cuts["primitive"].unique())

    @property
    def results(self) -> dict[str, pd.DataFrame]:
        """The final cuts of every primitive, in order of time: what primitives are learned from."""
        return {name: self.result(name) for name in self.primitives}

    def result(self, primitive: str, method: str = RESULT) -> pd.DataFrame:
        """Cuts of one primitive by one method; the reference has its crossing. Index: demonstration."""
        chosen = self.cuts[(self.cuts["primitive"] == primitive) & (self.cuts["method"] == method)]
        return chosen.set_index("demonstration")


def write_segmentation(segmentation: Segmentation, folder: str | Path) -> None:
    """Publish a segmentation as a folder of Parquet tables, one per attribute."""
    with publish(folder) as path:
        path.mkdir()
        write_table(segmentation.cuts, path / "cuts.parquet")
        write_table(segmentation.pairs, path / "pairs.parquet")
        write_table(segmentation.left_out, path / "left_out.parquet")
        write_table(segmentation.doubts, path / "doubts.parquet")
        write_table(pd.DataFrame({"reference": [segmentation.reference]}), path / "reference.parquet")


def read_segmentation(folder: str | Path) -> Segmentation:
    """Read a segmentation. Raises InputError: a table is missing, not readable or another one."""
    paths = {name: Path(folder, f"{name}.parquet") for name in COLUMNS}
    tables = {name: read_table(path, COLUMNS[name]) for name, path in paths.items()}
    reference = tables.pop("reference")["reference"]
    if len(reference) != 1:
        raise InputError(f"{paths['reference']}: has {len(reference)} rows, not one")
    return Segmentation(reference=reference[0], **tables)


COLUMNS = {
    "cuts": ("demonstration", "primitive", "method", "start_s", "end_s"),
    "pairs": ("demonstration", "primitive", "reference_s", "guess_s", "weight"),
    "left_out": ("demonstration", "reason"),
    "doubts": ("demonstration", "primitive", "reason", "number"),
    "reference": ("reference",),
}
"""Of the tables, by file."""
