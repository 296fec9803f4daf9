"""Recordings of the recorded data to look at: what was recorded, what was learned from it, deviations."""

from dataclasses import replace

import numpy as np

from structlearn.feedback.pmnn import read_networks
from structlearn.ground.artefacts import publish, read_table
from structlearn.ground.stage import run, stage_parameters
from structlearn.primitives import sequence
from structlearn.primitives.primitive_files import read_primitives, read_vector_primitive
from structlearn.primitives.sensor_traces import deviation, without_offset
from structlearn.recordings import read_demonstrations
from structlearn.testbeds.recorded.protocol.corrected_reaches import complete, typical_paths
from structlearn.testbeds.recorded.protocol.slides import GROUPS, SlideParameters, trial_group
from structlearn.viewer.learned_primitives import write_primitives
from structlearn.viewer.recorded_demonstrations import write_demonstrations

FOLDER = "reports/recordings/recorded"


def main() -> None:
    slides = stage_parameters("recorded_slides", SlideParameters)
    for name, heading in (("reaches", "97 reaches"), ("unscrewing", "Unscrewing")):
        demonstrations = read_demonstrations(f"data/raw/recorded/{name}")
        primitives = read_primitives(f"data/recorded/{name}/primitive.safetensors")
        path = sequence.unroll(primitives, demonstrations[0].dt, from_rest=False)
        tables = {"unrolled": sequence.sequence_table(path, [primitive.name for primitive in primitives])}
        with publish(f"{FOLDER}/{name}.rrd") as target:
            write_primitives(target, demonstrations, primitives, tables, f"{heading} and the primitive")

    higher = complete(read_demonstrations("data/raw/recorded/corrected_reaches"))
    nominal = read_primitives("data/recorded/reaches/primitive.safetensors")
    networks = read_networks("data/recorded/corrected_reaches/networks.safetensors")
    tables = {
        name: sequence.sequence_table(
            sequence.SequencePath(path, None, np.array([0, len(path.time) - 1])), [nominal[0].name]
        )
        for name, path in typical_paths(nominal[0].position, higher, list(networks.items())).items()
    }
    with publish(f"{FOLDER}/corrected_reaches.rrd") as target:
        write_primitives(target, higher, nominal, tables, "Higher reaches: the primitive with coupling")

    execution = read_demonstrations("data/raw/recorded/scraping")
    with publish(f"{FOLDER}/scraping_recorded.rrd") as target:
        write_demonstrations(target, execution, title="Scraping execution: as recorded")
    primitives = read_primitives("data/recorded/scraping/primitives.safetensors")
    tables = {"unrolled": read_table("data/recorded/scraping/sequence.parquet")}
    with publish(f"{FOLDER}/scraping_learned.rrd") as target:
        write_primitives(target, execution, primitives, tables, "Scraping execution: learned sequence")

    expected = read_vector_primitive("data/recorded/slides/expected.safetensors")
    trials = read_demonstrations(
        "data/raw/recorded/slides", rate_hz=slides.rate_hz, max_gap_s=slides.max_gap_s
    )
    trials.sort(key=lambda trial: GROUPS.index(trial_group(trial.name, slides)))  # the first ones have a tab
    deviating = [
        replace(trial, tactile=deviation(expected, without_offset(trial.tactile), trial.dt))
        for trial in trials
    ]
    with publish(f"{FOLDER}/slides.rrd") as target:
        write_demonstrations(target, deviating, title="Slides: deviation from the expected traces")


if __name__ == "__main__":
    run(main)
