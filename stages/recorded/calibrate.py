"""Measure the same statistics of touch on recordings and on the simulated robot's nominal executions."""

from structlearn.artefacts import publish, write_table
from structlearn.recorded import calibration
from structlearn.recorded.touch_traces import finger_traces, joined
from structlearn.recordings import read_recordings
from structlearn.stage import run, stage_parameters

SETS = {
    calibration.SIMULATED: "data/raw/scraping/unrolls",
    "unscrewing, recorded": "data/raw/recorded/unscrewing",
    "slides, recorded": "data/raw/recorded/slides",
}


def main() -> None:
    parameters = stage_parameters("calibrate", calibration.CalibrationParameters)
    clock = parameters.rate_hz, parameters.settling_s
    primitives = read_recordings("data/raw/recorded/scraping")
    traces = joined(calibration.REFERENCE, "execution", primitives, *clock)
    for group, folder in SETS.items():
        for recording in read_recordings(folder):
            traces += finger_traces(group, recording, *clock)
    electrodes = calibration.electrode_table(traces, parameters)
    fingers = calibration.finger_table(traces, electrodes, parameters)
    spectra = calibration.spectrum_table(traces, parameters)
    with publish("data/recorded/calibration") as folder:
        folder.mkdir()
        write_table(electrodes, folder / "electrodes.parquet")
        write_table(fingers, folder / "fingers.parquet")
        write_table(spectra, folder / "spectra.parquet")
        write_table(calibration.component_table(traces), folder / "components.parquet")
        write_table(calibration.trace_table(traces, parameters), folder / "traces.parquet")
        write_table(calibration.comparison(fingers, spectra, parameters), folder / "comparison.parquet")


if __name__ == "__main__":
    run(main)
