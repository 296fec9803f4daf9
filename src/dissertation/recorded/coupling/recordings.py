"""Published samples of the coupling term."""

from pathlib import Path

from dissertation.recorded.coupling.parameters import CouplingParameters
from dissertation.recorded.readers.coupling_samples import read_coupling
from structlearn.avoidance.avoidance_dataset import avoidance_table
from structlearn.core.artefacts import write_metrics, write_table
from structlearn.tasks.task_import import LeftOut, read_source


def write(task: CouplingParameters, folder: Path, left_out: LeftOut) -> None:
    """Write `samples` with their `provenance`."""
    found = read_source(task, task.source, left_out, read_coupling)
    write_table(avoidance_table(found.samples), folder / "samples.parquet")
    write_metrics(found.provenance, folder / "provenance.json")
