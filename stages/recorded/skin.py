"""A magnetic skin pressed at known places: its latent map, forces, and servoing in the map (chapter II)."""

from structlearn.core.artefacts import filled, publish
from structlearn.core.stage import or_empty, run, stage_parameters
from structlearn.readers.touch_log import read_touch_logs
from structlearn.tasks.public import PARAMETER_FILE
from structlearn.tasks.touch.skin_touches import learn_touch
from structlearn.tasks.touch.touch_parameters import TouchParameters


def main() -> None:
    parameters = stage_parameters("recorded_skin", TouchParameters, PARAMETER_FILE)
    logs = read_touch_logs(filled(parameters.source), parameters.channels)
    with publish("data/recorded/skin") as folder:
        folder.mkdir()
        learn_touch(logs, parameters, folder)


if __name__ == "__main__":
    run(or_empty(main, "data/recorded/skin"))
