"""Bring the public recordings into the pipeline: text logs to MCAP, samples to tables, provenance kept."""

from collections.abc import Sequence
from pathlib import Path
from shutil import copyfile

from structlearn.avoidance.avoidance_dataset import AvoidanceDataset, to_table
from structlearn.ground.artefacts import publish, write_metrics, write_table
from structlearn.ground.errors import InputError, MissingInputError
from structlearn.ground.stage import run, stage_parameters
from structlearn.recordings import clmc, eflesh, panda, slide, ur10e, write_recordings
from structlearn.recordings.joint_log import DriveLog, JointLog, write_log_table
from structlearn.recordings.reaches_past_boxes import read_reaches_past_boxes
from structlearn.recordings.source import PublicSourceParameters
from structlearn.testbeds.recorded.protocol.avoidance_samples import (
    avoidance_provenance,
    read_avoidance_samples,
)


def write_avoidance(found: tuple[AvoidanceDataset, dict[str, str]], target: Path) -> None:
    samples, provenance = found
    write_table(to_table(samples), target / "samples.parquet")
    write_metrics(provenance, target / "provenance.json")


def write_panda(logs: Sequence[JointLog], target: Path) -> None:
    write_log_table(logs, target / "logs.parquet")


def write_ur10e(found: tuple[Sequence[DriveLog], Path], target: Path) -> None:
    logs, urdf = found
    write_log_table(logs, target / "logs.parquet")
    copyfile(urdf, target / ur10e.URDF)


WRITERS = {
    "avoidance": write_avoidance,
    "panda": write_panda,
    "skin": eflesh.write_runs,
    "ur10e": write_ur10e,
}
"""Of sets that are not demonstrations."""


def main() -> None:
    parameters = stage_parameters("import_recordings", PublicSourceParameters)
    folder = parameters.folder
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; name that of the recordings: make recorded DATA=FOLDER")
    clmc_folder = folder / "clmc"
    sets = {
        "reaches": lambda: clmc.read_reaches(clmc_folder, parameters.reaches),
        "corrected_reaches": lambda: clmc.read_reaches(clmc_folder, parameters.corrected_reaches),
        "unscrewing": lambda: clmc.read_unscrewing(clmc_folder),
        "scraping": lambda: clmc.read_scraping_execution(clmc_folder, parameters.scraping),
        "slides": lambda: slide.read_slides(folder / "slide", parameters.slide_trials),
        "avoidance": lambda: (read_avoidance_samples(clmc_folder), avoidance_provenance(clmc_folder)),
        "boxes": lambda: read_reaches_past_boxes(folder / "reaches_past_boxes"),
        "skin": lambda: eflesh.read_all_runs(folder / "eflesh"),
        "panda": lambda: panda.read_trajectories(folder / "panda"),
        "ur10e": lambda: (ur10e.read_logs(folder / "ur10e"), ur10e.urdf_path(folder / "ur10e")),
    }
    found = {}
    for name, read in sets.items():
        try:
            found[name] = read()
        except MissingInputError as missing:
            print(f"{name}: not recorded here: {missing}")
    if not found:
        raise InputError(f"{folder}: holds none of the recordings")
    for name in sets:
        with publish(f"data/raw/recorded/{name}") as target:
            target.mkdir()
            if name in found:
                WRITERS.get(name, write_recordings)(found[name], target)


if __name__ == "__main__":
    run(main)
