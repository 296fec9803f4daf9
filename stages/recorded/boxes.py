"""Reaches past boxes: learned from some people, tried in the scenes of others (dissertation IV.8)."""

from structlearn.ground.artefacts import filled, publish, write_table
from structlearn.ground.stage import or_empty, run, stage_parameters
from structlearn.recordings import read_recordings, synchronise
from structlearn.testbeds.recorded import PARAMETER_FILE
from structlearn.testbeds.recorded.protocol.boxes_people import BoxesParameters, learn_past_boxes


def main() -> None:
    parameters = stage_parameters("recorded_boxes", BoxesParameters, PARAMETER_FILE)
    recordings = read_recordings(filled("data/raw/recorded/boxes"))
    trials = [
        synchronise(one, refuse_jumps=False) for one in recordings
    ]  # the protocol names what it leaves out
    results = learn_past_boxes(trials, parameters)
    with publish("data/recorded/boxes") as folder:
        folder.mkdir()
        for name, table in vars(results).items():
            write_table(table, folder / f"{name}.parquet")


if __name__ == "__main__":
    run(or_empty(main, "data/recorded/boxes"))
