"""The report on recorded data: figures, tables, metrics and the page that shows them."""

from dataclasses import fields

import pandas as pd

from structlearn.ground.artefacts import read_metrics, read_table
from structlearn.ground.stage import run, stage_parameters
from structlearn.primitives.fitting import FitParameters, segment_paths, whole
from structlearn.primitives.primitive_files import read_primitives
from structlearn.recordings import read_demonstrations
from structlearn.reporting.page import Link
from structlearn.reporting.publishing import publish_report
from structlearn.testbeds.recorded.page.recorded_page import pictures, recorded_page
from structlearn.testbeds.recorded.page.recorded_results import RecordedResults, metrics, tables
from structlearn.testbeds.recorded.protocol.avoidance_representations import (
    RecordedAvoidanceParameters,
    RecordedAvoidanceResults,
)
from structlearn.testbeds.recorded.protocol.correction_splits import CorrectionParameters, CorrectionResults
from structlearn.testbeds.recorded.protocol.human_reaches import ReachParameters
from structlearn.testbeds.recorded.protocol.latent_touch import LatentTouchParameters, LatentTouchResults
from structlearn.testbeds.recorded.protocol.panda_identification import (
    RecordedDynamicsParameters,
    RecordedDynamicsResults,
)
from structlearn.testbeds.recorded.protocol.scraping_execution import ExecutionParameters
from structlearn.testbeds.recorded.protocol.slides import SlideParameters

DATA = "data/recorded"
PARAMETERS = {
    "recorded_reaches": ReachParameters,
    "recorded_corrections": CorrectionParameters,
    "recorded_unscrewing": FitParameters,
    "recorded_scraping": ExecutionParameters,
    "recorded_slides": SlideParameters,
    "recorded_avoidance": RecordedAvoidanceParameters,
    "recorded_latent_touch": LatentTouchParameters,
    "recorded_dynamics": RecordedDynamicsParameters,
}
RECORDINGS = tuple(
    Link(f"../recordings/recorded/{name}.rrd", f"{name}.rrd", note)
    for name, note in (
        ("reaches", "97 reaches with the primitive learned from them"),
        (
            "corrected_reaches",
            "28 higher reaches and the nominal primitive, with and without learned coupling",
        ),
        ("unscrewing", "three logs and the primitive learned from all of them"),
        ("scraping_recorded", "the execution with its electrodes"),
        ("scraping_learned", "the sequence learned from it"),
        ("slides", "24 slides; the electrodes show their deviation from the expected traces"),
    )
)


def main() -> None:
    parameters = {key: stage_parameters(key, model) for key, model in PARAMETERS.items()}
    reaches = read_demonstrations("data/raw/recorded/reaches")
    logs = read_demonstrations("data/raw/recorded/unscrewing")
    smoothing = (
        parameters["recorded_reaches"].fit.smoothing_hz,
        parameters["recorded_unscrewing"].smoothing_hz,
    )
    results = RecordedResults(
        reach_segments=segment_paths(reaches, whole(reaches), smoothing[0]),
        reach_primitive=read_primitives(f"{DATA}/reaches/primitive.safetensors")[0],
        reach_errors=read_table(f"{DATA}/reaches/reproduction.parquet"),
        reach_cut_errors=read_table(f"{DATA}/reaches/cut_errors.parquet"),
        own_spread_mm=read_metrics(f"{DATA}/reaches/spread.json")["own_spread_mm"],
        corrections=CorrectionResults(**_tables(CorrectionResults, "corrected_reaches")),
        unscrewing_segments=segment_paths(logs, whole(logs), smoothing[1]),
        unscrewing_primitive=read_primitives(f"{DATA}/unscrewing/primitive.safetensors")[0],
        unscrewing_errors=read_table(f"{DATA}/unscrewing/errors.parquet"),
        execution=read_demonstrations("data/raw/recorded/scraping"),
        execution_path=read_table(f"{DATA}/scraping/sequence.parquet"),
        execution_errors=read_table(f"{DATA}/scraping/errors.parquet"),
        electrode_scores=read_table(f"{DATA}/scraping/electrode_scores.parquet"),
        electrode_traces=read_table(f"{DATA}/scraping/electrode_traces.parquet"),
        clock_errors=read_table(f"{DATA}/slides/clock_errors.parquet"),
        slide_deviations=read_table(f"{DATA}/slides/deviations.parquet"),
        slide_statistics=read_table(f"{DATA}/slides/statistics.parquet"),
        avoidance=RecordedAvoidanceResults(**_tables(RecordedAvoidanceResults, "avoidance")),
        latent_touch=LatentTouchResults(**_tables(LatentTouchResults, "latent_touch")),
        dynamics=RecordedDynamicsResults(**_tables(RecordedDynamicsResults, "dynamics")),
        slide_torques=read_table(f"{DATA}/dynamics/slide_torques.parquet"),
        slide_payloads=read_table(f"{DATA}/dynamics/slide_payloads.parquet"),
    )
    publish_report(
        "reports/recorded",
        pictures(results),
        tables(results),
        metrics(results),
        lambda sizes: recorded_page(results, sizes, parameters, RECORDINGS),
    )


def _tables(results: type, folder: str) -> dict[str, pd.DataFrame]:
    """A table of the same name for every field."""
    return {field.name: read_table(f"{DATA}/{folder}/{field.name}.parquet") for field in fields(results)}


if __name__ == "__main__":
    run(main)
