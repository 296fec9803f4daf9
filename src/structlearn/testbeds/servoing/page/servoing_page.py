"""The page of the servoing testbed: its sections in order."""

from collections.abc import Mapping, Sequence

from structlearn.ground.params import Parameters
from structlearn.reporting.page import HOW_TO_OPEN, Block, KeyNumber, Link, Links, Page, Prose, Section, Sizes
from structlearn.reporting.parameter_table import parameter_table
from structlearn.testbeds.servoing.page import (
    servoing_loop_sections,
    servoing_sections,
    servoing_skin_sections,
)
from structlearn.testbeds.servoing.page.servoing_loop import ACTING, TEXT
from structlearn.testbeds.servoing.page.servoing_results import ServoingResults

LEAD = (
    "A finger learns from demonstrations to bring a contact to where it is wanted on its skin: touch "
    "becomes a latent state with the geometry of the skin, and learned dynamics of this state are "
    "inverted. {} Dissertation, chapter II."
)
SIMULATED = "The finger, its sensor and the handle on this page are simulated."
RECORDED = (
    "The demonstrations are your own recordings; a closed loop needs the finger itself and is not shown, but "
    "for the other skins."
)


def servoing_page(
    results: ServoingResults,
    sizes: Sizes,
    parameters: Mapping[str, Parameters],
    recordings: Sequence[Link] = (),
) -> Page:
    """The page; figures are expected as `figures/NAME.png`, tables as `tables/NAME.csv`.

    Args:
        results: what to show.
        sizes: of the figures of `servoing_sections.pictures`.
        parameters: by their key in `params.yaml`.
        recordings: links to .rrd files.
    """
    contact_points = [servoing_sections.contact_points(results, sizes)] if results.simulated else []
    loops = []
    if results.loop is not None:
        loops = [
            servoing_loop_sections.closed_loop(results.loop, sizes),
            servoing_loop_sections.beyond(results.loop),
        ]
    return Page(
        title="Tactile servoing in a learned latent space",
        lead=LEAD.format(SIMULATED if results.simulated else RECORDED),
        key_numbers=_key_numbers(results),
        sections=(
            servoing_sections.demonstrations(results),
            servoing_sections.claims(results),
            *contact_points,
            servoing_sections.latent_space(results, sizes),
            servoing_sections.forward_models(results, sizes),
            servoing_sections.inverse_models(results, sizes),
            *loops,
            servoing_skin_sections.other_skins(results.other_skins),
            _files(parameters, recordings),
        ),
        simulated=results.simulated,
        back=Link("../index.html", "All testbeds"),
    )


def _key_numbers(results: ServoingResults) -> tuple[KeyNumber, ...]:
    numbers = (
        KeyNumber(
            f"{results.latents('reconstruction').mean():.3f}",
            "reconstruction NMSE, test contacts; published: below 0.25",
        ),
        KeyNumber(
            f"{results.latents('distances').mean():.4f}",
            "NMSE of map distances, test contacts; published: below 0.02",
        ),
        KeyNumber(
            f"{results.cosines('NJ').mean():.2f}",
            "cosine distance of NJ's actions to the demonstrated ones; 1 is a right angle",
        ),
    )
    if results.loop is None:
        return numbers
    text, acting = results.loop.rate(TEXT), results.loop.rate(ACTING)
    reached = KeyNumber(
        f"{100 * text['rate']:.0f} % | {100 * acting['rate']:.0f} %",
        f"of {acting['trials']:.0f} targets reached in closed loop by NJ as published | acting more "
        "cautiously",
    )
    return (*numbers, reached)


def _files(parameters: Mapping[str, Parameters], recordings: Sequence[Link]) -> Section:
    blocks: list[Block] = []
    if recordings:
        blocks += [Prose(HOW_TO_OPEN), Links(tuple(recordings))]
    blocks += [
        Prose(
            "The numbers on this page are in these files or follow from `data/servoing`, but for those "
            "that are said to come from outside the pipeline."
        ),
        Links((Link("metrics.json", "metrics.json", "the key figures, for `dvc metrics show`"),)),
        parameter_table(parameters),
    ]
    return Section("Files and parameters", tuple(blocks))
