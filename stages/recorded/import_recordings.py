"""Bring the public recordings into the pipeline: text logs to MCAP, samples to a table, provenance kept."""

from structlearn.avoidance.avoidance_dataset import to_table
from structlearn.ground.artefacts import publish, write_metrics, write_table
from structlearn.ground.stage import run, stage_parameters
from structlearn.recordings import clmc, eflesh, panda, slide, write_recordings
from structlearn.recordings.joint_log import write_joint_log
from structlearn.recordings.source import PublicSourceParameters
from structlearn.testbeds.recorded.protocol.avoidance_samples import (
    avoidance_provenance,
    read_avoidance_samples,
)


def main() -> None:
    parameters = stage_parameters("import_recordings", PublicSourceParameters)
    folder = parameters.folder
    sets = {
        "reaches": clmc.read_reaches(folder / "clmc"),
        "corrected_reaches": clmc.read_reaches(folder / "clmc", "dataset2_part"),
        "unscrewing": clmc.read_unscrewing(folder / "clmc"),
        "scraping": clmc.read_scraping_execution(folder / "clmc"),
        "slides": slide.read_slides(folder / "slide", parameters.slide_trials),
    }
    samples = read_avoidance_samples(folder / "clmc")
    trajectory = panda.read_exciting_trajectory(folder / "panda")
    for name, recordings in sets.items():
        with publish(f"data/raw/recorded/{name}") as target:
            write_recordings(recordings, target)
    with publish("data/raw/recorded/avoidance") as target:
        target.mkdir()
        write_table(to_table(samples), target / "samples.parquet")
        write_metrics(avoidance_provenance(folder / "clmc"), target / "provenance.json")
    with publish("data/raw/recorded/panda") as target:
        target.mkdir()
        write_joint_log(trajectory, target / "exciting_trajectory.mcap")
    with publish("data/raw/recorded/skin") as target:
        target.mkdir()
        eflesh.import_runs(folder / "eflesh", target)


if __name__ == "__main__":
    run(main)
