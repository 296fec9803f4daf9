"""Search for the open-loop policy with PI2-CMA and CMA-ES on equal budgets of rollouts (IV.7.2)."""

from collections.abc import Mapping
from dataclasses import replace

from dissertation.scraping.protocol.board_refinement import (
    BoardEnvironment,
    BoardRefinementParameters,
    read_board,
)
from dissertation.scraping.protocol.execution_scores import AFTER, BEFORE
from dissertation.scraping.protocol.sample_efficiency import ComparisonParameters, compare_searches
from dissertation.scraping.world.testbed import TestbedParameters, drawn_testbed
from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import run, stage_parameters
from structlearn.feedback.coupling_model import CouplingModel, read_networks
from structlearn.feedback.coupling_targets import SupervisionParameters
from structlearn.policy_search import refinement
from structlearn.readers.source import ClockParameters

import pandas as pd

DATA = "data/feedback/scraping"


def main() -> None:
    parameters = stage_parameters("compare_search", ComparisonParameters)
    refined = stage_parameters("refine", BoardRefinementParameters)
    supervision = stage_parameters("coupling_dataset", SupervisionParameters)
    testbed = drawn_testbed(stage_parameters("testbed", TestbedParameters))
    clock = stage_parameters("clock", ClockParameters)
    with publish(f"{DATA}/search") as folder:
        folder.mkdir()
        board, _ = read_board("data", refined, supervision, testbed, clock)
        before, after = (read_networks(f"{DATA}/refinement/{model}.safetensors") for model in (BEFORE, AFTER))
        write_table(searches(board, before, after, refined, parameters), folder / "trials.parquet")


def searches(
    board: BoardEnvironment,
    before: Mapping[str, CouplingModel],
    after: Mapping[str, CouplingModel],
    refined: BoardRefinementParameters,
    parameters: ComparisonParameters,
) -> pd.DataFrame:
    """Trials of both searches per refined primitive, from the policy of its model before refinement."""
    tables = []
    for name in [one.name for one in board.skill.primitives if one.name in refined.exploration]:
        own, exploration = board.of(name, after), refined.exploration[name]
        start = refinement.start(own, before[name], refined, exploration).compressed
        first = refined.seed * parameters.seeds
        searched = replace(own, with_samples=False)
        table = compare_searches(searched, start, exploration, refined.search, parameters, first)
        tables.append(table.assign(primitive=name))
    return pd.concat(tables, ignore_index=True)


if __name__ == "__main__":
    run(main)
