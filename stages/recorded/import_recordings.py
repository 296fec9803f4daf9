"""Bring the public recordings into the pipeline: text logs to MCAP, samples to a table, provenance kept."""

from structlearn.avoidance.avoidance_dataset import to_table
from structlearn.ground.artefacts import publish, write_metrics, write_table
from structlearn.ground.errors import InputError, MissingInputError
from structlearn.ground.stage import run, stage_parameters
from structlearn.recordings import clmc, panda, slide, write_recordings
from structlearn.recordings.joint_log import write_joint_log
from structlearn.recordings.source import PublicSourceParameters
from structlearn.testbeds.recorded.protocol.avoidance_samples import (
    avoidance_provenance,
    read_avoidance_samples,
)


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
        "avoidance": lambda: read_avoidance_samples(clmc_folder),
        "panda": lambda: panda.read_trajectories(folder / "panda"),
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
            if name == "avoidance" and name in found:
                write_table(to_table(found[name]), target / "samples.parquet")
                write_metrics(avoidance_provenance(clmc_folder), target / "provenance.json")
            elif name == "panda":
                for log in found.get(name, ()):
                    write_joint_log(log, target / f"{log.name}.mcap")
            else:
                write_recordings(found.get(name, ()), target)


if __name__ == "__main__":
    run(main)
