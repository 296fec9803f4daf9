"""The page of the obstacle testbed: its sections in order."""

from collections.abc import Mapping, Sequence

from structlearn.avoidance.learned_models import NETWORK, SETTING
from structlearn.avoidance.shapes import SHAPES
from structlearn.ground.params import Parameters
from structlearn.reporting.page import HOW_TO_OPEN, Block, KeyNumber, Link, Links, Page, Prose, Section, Sizes
from structlearn.reporting.parameter_table import parameter_table
from structlearn.testbeds.obstacles.page import obstacle_sections
from structlearn.testbeds.obstacles.page.obstacle_results import ObstacleResults
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import TRAINED, UNSEEN

LEAD = (
    "A reach learns from demonstrations how people avoid obstacles: a network turns what is near the hand "
    "into a coupling term of the movement primitive. All people, hands and obstacles on this page are "
    "simulated. Dissertation, section IV.8."
)


def obstacle_page(
    results: ObstacleResults,
    sizes: Sizes,
    parameters: Mapping[str, Parameters],
    recordings: Sequence[Link] = (),
) -> Page:
    """The page; figures are expected as `figures/NAME.png`, tables as `tables/NAME.csv`.

    Args:
        results: what to show.
        sizes: of the figures of `obstacle_sections.pictures`.
        parameters: by their key in `params.yaml`.
        recordings: links to .rrd files.
    """
    return Page(
        title="Obstacle avoidance: coupling terms from demonstrations",
        lead=LEAD,
        key_numbers=_key_numbers(results),
        sections=(
            obstacle_sections.demonstrations(results, sizes),
            obstacle_sections.claims(results),
            obstacle_sections.fit(results, sizes),
            obstacle_sections.per_setting(results, sizes),
            obstacle_sections.per_shape(results),
            obstacle_sections.unseen(results, sizes),
            obstacle_sections.goals(results),
            obstacle_sections.all_shapes(results),
            obstacle_sections.beyond(results, sizes),
            _files(parameters, recordings),
        ),
        simulated=results.simulated,
        back=Link("../index.html", "All testbeds"),
    )


def _key_numbers(results: ObstacleResults) -> tuple[KeyNumber, ...]:
    hits = {shape: results.hits(UNSEEN, NETWORK, shape) for shape in SHAPES}
    worst = max(results.fit(NETWORK, shape, shape)["nmse_worse"] for shape in SHAPES)
    total = len(results.rows(UNSEEN))
    return (
        KeyNumber(
            f"{results.hits(TRAINED, NETWORK, SETTING)} of {len(results.rows(TRAINED, NETWORK, SETTING))}",
            f"trained scenarios hit by networks; {results.hits(TRAINED)} without avoidance",
        ),
        KeyNumber(
            " | ".join(str(count) for count in hits.values()) + f" of {total}",
            f"unseen spheres hit by networks that learned from {' | '.join(hits)}; {results.hits(UNSEEN)} "
            "without avoidance",
        ),
        KeyNumber(f"{worst:.2f}", "held-out NMSE of networks per shape, worst of y and z"),
        KeyNumber(
            f"{100 * results.limited['goal_distance_m'].max():.1f} cm",
            "largest distance from the goal at the prescribed time, all models and situations",
        ),
    )


def _files(parameters: Mapping[str, Parameters], recordings: Sequence[Link]) -> Section:
    blocks: list[Block] = []
    if recordings:
        blocks += [Prose(HOW_TO_OPEN), Links(tuple(recordings))]
    blocks += [
        Prose(
            "The numbers on this page are in these files or follow from `data/obstacles`, but for those of "
            "trials that are called so."
        ),
        Links(
            (
                Link("metrics.json", "metrics.json", "the key figures, for `dvc metrics show`"),
                Link(
                    "tables/summary.csv",
                    "tables/summary.csv",
                    "every model in every situation, with either rules",
                ),
                Link(
                    "tables/fit_per_scenario.csv",
                    "tables/fit_per_scenario.csv",
                    "errors of every model per scenario and axis",
                ),
            )
        ),
        parameter_table(parameters),
    ]
    return Section("Files and parameters", tuple(blocks))
