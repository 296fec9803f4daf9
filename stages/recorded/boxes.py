"""Reaches past boxes: learned from some people, tried in the scenes of others (dissertation IV.8)."""

from structlearn.avoidance.scene_people import ScenePeopleParameters, learn_past_obstacles
from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import or_empty, run, stage_parameters
from structlearn.tasks.public import PARAMETER_FILE
from structlearn.tasks.public.public_files import RecordedFiles


def main() -> None:
    parameters = stage_parameters("recorded_boxes", ScenePeopleParameters, PARAMETER_FILE)
    results = learn_past_obstacles(RecordedFiles().runs("boxes"), parameters)
    with publish("data/recorded/boxes") as folder:
        folder.mkdir()
        for name, table in vars(results).items():
            write_table(table, folder / f"{name}.parquet")


if __name__ == "__main__":
    run(or_empty(main, "data/recorded/boxes"))
