"""Rerun view of all methods side by side, by the person whom `params.yaml` names: run by hand."""

from dissertation.rivals.imitation_data import recorded_person
from dissertation.rivals.page.rivals_view import executed_once, side_by_side
from dissertation.rivals.protocol import ComparisonParameters, MethodParameters
from structlearn.core.stage import run, stage_parameters
from structlearn.viewer.recording import publish_recordings

UNSEEN_DEG = 8.8


def main() -> None:
    parameters = stage_parameters("rivals", ComparisonParameters)
    methods = stage_parameters("rival_methods", MethodParameters)
    _, bench, recorded = recorded_person(parameters.demonstrations)
    shown = executed_once(bench, recorded, methods, UNSEEN_DEG, parameters.seed)
    publish_recordings("reports/rerun/rivals", {"side_by_side": side_by_side(shown)})


if __name__ == "__main__":
    run(main)
