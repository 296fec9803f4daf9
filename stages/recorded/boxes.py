"""Reaches past boxes: learned from some people, tried in the scenes of others (dissertation IV.8)."""

from pathlib import Path

from structlearn.ground.artefacts import publish, write_table
from structlearn.ground.stage import run, stage_parameters
from structlearn.recordings import read_demonstrations
from structlearn.testbeds.recorded.protocol.boxes_parameters import BoxesParameters
from structlearn.testbeds.recorded.protocol.boxes_people import learn_past_boxes


def main() -> None:
    parameters = stage_parameters("recorded_boxes", BoxesParameters)
    source = Path("data/raw/recorded/boxes")
    recorded = any(
        source.iterdir()
    )  # the folder of a set that is not at hand is empty, and so is what follows
    tables = vars(learn_past_boxes(read_demonstrations(source), parameters)) if recorded else {}
    with publish("data/recorded/boxes") as folder:
        folder.mkdir()
        for name, table in tables.items():
            write_table(table, folder / f"{name}.parquet")


if __name__ == "__main__":
    run(main)
