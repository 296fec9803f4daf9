"""The report on recorded data: figures, tables, metrics and the page that shows them."""

from structlearn.artefacts import publish, read_metrics, read_table, write_csv, write_metrics
from structlearn.primitives.storage import read_primitives
from structlearn.recorded.reaches import ReachParameters
from structlearn.recorded.scraping import ExecutionParameters
from structlearn.recorded.slides import SlideParameters
from structlearn.recordings import read_demonstrations
from structlearn.reporting.figures import save
from structlearn.reporting.page import Link, render
from structlearn.reporting.recorded_page import RecordedResults, metrics, pictures, recorded_page, tables
from structlearn.segmentation.learning import FitParameters, segment_paths, whole
from structlearn.stage import run, stage_parameters

PARAMETERS = {
    "recorded_reaches": ReachParameters,
    "recorded_unscrewing": FitParameters,
    "recorded_scraping": ExecutionParameters,
    "recorded_slides": SlideParameters,
}
RECORDINGS = tuple(
    Link(f"../recordings/recorded/{name}.rrd", f"{name}.rrd", note)
    for name, note in (
        ("reaches", "97 reaches with the primitive learned from them"),
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
    data = "data/recorded"
    results = RecordedResults(
        reach_segments=segment_paths(reaches, whole(reaches), smoothing[0]),
        reach_primitive=read_primitives(f"{data}/reaches/primitive.safetensors")[0],
        reach_errors=read_table(f"{data}/reaches/reproduction.parquet"),
        reach_cut_errors=read_table(f"{data}/reaches/cut_errors.parquet"),
        own_spread_mm=read_metrics(f"{data}/reaches/spread.json")["own_spread_mm"],
        unscrewing_segments=segment_paths(logs, whole(logs), smoothing[1]),
        unscrewing_primitive=read_primitives(f"{data}/unscrewing/primitive.safetensors")[0],
        unscrewing_errors=read_table(f"{data}/unscrewing/errors.parquet"),
        execution=read_demonstrations("data/raw/recorded/scraping"),
        execution_path=read_table(f"{data}/scraping/sequence.parquet"),
        execution_errors=read_table(f"{data}/scraping/errors.parquet"),
        electrode_scores=read_table(f"{data}/scraping/electrode_scores.parquet"),
        electrode_traces=read_table(f"{data}/scraping/electrode_traces.parquet"),
        clock_errors=read_table(f"{data}/slides/clock_errors.parquet"),
        slide_deviations=read_table(f"{data}/slides/deviations.parquet"),
        slide_statistics=read_table(f"{data}/slides/statistics.parquet"),
    )
    with publish("reports/recorded/figures") as folder:
        folder.mkdir()
        sizes = {name: save(figure, folder / f"{name}.png") for name, figure in pictures(results).items()}
    with publish("reports/recorded/tables") as folder:
        folder.mkdir()
        for name, table in tables(results).items():
            write_csv(table, folder / f"{name}.csv")
    write_metrics(metrics(results), "reports/recorded/metrics.json")
    with publish("reports/recorded/index.html") as path:
        path.write_text(render(recorded_page(results, sizes, parameters, RECORDINGS)), encoding="utf-8")


if __name__ == "__main__":
    run(main)
