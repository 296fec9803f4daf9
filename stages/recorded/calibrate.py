"""Measure the same statistics of touch on recordings and on the simulated robot's nominal executions."""

from pathlib import Path

from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import or_empty, run, stage_parameters
from structlearn.readers import read_recordings
from structlearn.tasks.public import PARAMETER_FILE
from structlearn.tasks.public.protocol import touch_calibration
from structlearn.tasks.public.protocol.touch_statistics import finger_traces, joined
from structlearn.tasks.public.public_files import SCRAPING, SLIDES, UNSCREWING, RecordedFiles

SIMULATED = Path("data/raw/scraping/unrolls")
SETS = {"unscrewing, recorded": UNSCREWING, "slides, recorded": SLIDES}


def main() -> None:
    parameters = stage_parameters("calibrate", touch_calibration.CalibrationParameters, PARAMETER_FILE)
    clock = parameters.rate_hz, parameters.settling_s
    stored = RecordedFiles()
    traces = joined(touch_calibration.REFERENCE, "execution", stored.streams(SCRAPING), *clock)
    groups = {touch_calibration.SIMULATED: read_recordings(SIMULATED) if any(SIMULATED.iterdir()) else []}
    groups |= {group: stored.streams(name) for group, name in SETS.items() if stored.imported(name)}
    for group, recordings in groups.items():
        for recording in recordings:
            traces += finger_traces(group, recording, *clock)
    electrodes = touch_calibration.electrode_table(traces, parameters)
    fingers = touch_calibration.finger_table(traces, electrodes, parameters)
    spectra = touch_calibration.spectrum_table(traces, parameters)
    with publish("data/recorded/calibration") as folder:
        folder.mkdir()
        write_table(electrodes, folder / "electrodes.parquet")
        write_table(fingers, folder / "fingers.parquet")
        write_table(spectra, folder / "spectra.parquet")
        write_table(touch_calibration.component_table(traces), folder / "components.parquet")
        write_table(touch_calibration.trace_table(traces, parameters), folder / "traces.parquet")
        write_table(touch_calibration.comparison(fingers, spectra, parameters), folder / "comparison.parquet")


if __name__ == "__main__":
    run(or_empty(main, "data/recorded/calibration"))
