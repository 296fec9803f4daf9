"""Refine the feedback models by reinforcement learning on an unseen tilt of the board (IV.7, IV.9.4)."""

from dissertation.scraping.protocol.board_refinement import (
    BoardRefinementParameters,
    read_board,
    refine_on_board,
)
from dissertation.scraping.world.testbed import TestbedParameters, drawn_testbed
from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import run, stage_parameters
from structlearn.feedback.coupling_model import write_networks
from structlearn.feedback.coupling_targets import SupervisionParameters
from structlearn.policy_search.refinement import Progress
from structlearn.readers.source import ClockParameters


def main() -> None:
    parameters = stage_parameters("refine", BoardRefinementParameters)
    supervision = stage_parameters("coupling_dataset", SupervisionParameters)
    testbed = drawn_testbed(stage_parameters("testbed", TestbedParameters))
    clock = stage_parameters("clock", ClockParameters)
    with publish("data/feedback/scraping/refinement") as folder:
        folder.mkdir()
        board, datasets = read_board("data", parameters, supervision, testbed, clock)
        before, after, tables = refine_on_board(board, datasets, parameters, tell)
        write_networks(list(before.items()), folder / "before.safetensors")
        write_networks(list(after.items()), folder / "after.safetensors")
        for name, table in tables.items():
            write_table(table, folder / f"{name}.parquet")


def tell(name: str, progress: Progress) -> None:
    """Print mean costs and failures of an iteration."""
    now = progress.history[progress.history["iteration"] == progress.iteration]
    costs = ", ".join(f"{kind} {rows['cost_rad'].mean():.1f}" for kind, rows in now.groupby("kind"))
    failed = int((now["fault"] != "").sum())
    print(
        f"{name}, iteration {progress.iteration}: mean cost {costs} rad, {failed} of {len(now)} failed",
        flush=True,
    )


if __name__ == "__main__":
    run(main)
