"""Reaches past boxes: learned from some people, tried in the scenes of others (dissertation IV.8)."""

from structlearn.avoidance.scene_people import ScenePeopleParameters, learn_past_obstacles
from structlearn.ground.artefacts import publish, write_table
from structlearn.ground.stage import or_empty, run, stage_parameters
from structlearn.testbeds.recorded import PARAMETER_FILE
from structlearn.testbeds.recorded.files import RecordedFiles


def main() -> None:
    parameters = stage_parameters("recorded_boxes", ScenePeopleParameters, PARAMETER_FILE)
    results = learn_past_obstacles(RecordedFiles().runs("boxes"), parameters)
    with publish("data/recorded/boxes") as folder:
        folder.mkdir()
        for name, table in vars(results).items():
            write_table(table, folder / f"{name}.parquet")


if __name__ == "__main__":
    run(or_empty(main, "data/recorded/boxes"))
