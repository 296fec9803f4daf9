"""The sections of the servoing page on demonstrations, latent spaces and models."""

from matplotlib.figure import Figure as Picture

from structlearn.reporting.page import Block, Prose, Section, Sizes, Table, beside
from structlearn.testbeds.servoing.page import (
    servoing_figures,
    servoing_loop_figures,
    servoing_prose,
    servoing_tables,
)
from structlearn.testbeds.servoing.page.servoing_claims import claims_frame, servoing_claims
from structlearn.testbeds.servoing.page.servoing_departures import departures
from structlearn.testbeds.servoing.page.servoing_published import TEST_CHAIN
from structlearn.testbeds.servoing.page.servoing_results import SQUARE_MM, ServoingResults
from structlearn.testbeds.servoing.page.servoing_tables import COMPARISONS, LATENT_COLUMNS


def pictures(results: ServoingResults) -> dict[str, Picture]:
    """All figures of the page by name."""
    found = {
        "map": servoing_figures.map_figure(results),
        "curve": servoing_figures.curve_figure(results),
        "forward": servoing_figures.forward_figure(results),
        "directions": servoing_figures.directions_figure(results),
    }
    if results.simulated:
        found["contact"] = servoing_figures.contact_figure(results)
    if results.loop is not None:
        found |= servoing_loop_figures.pictures(results.loop, results.skin)
    return found


def demonstrations(results: ServoingResults) -> Section:
    """What was demonstrated, and what is learned from it."""
    return Section(
        "Demonstrations",
        (
            Prose(servoing_prose.what(results)),
            Table(
                servoing_tables.data(results),
                "The data beside the dissertation's (II.4.1.1).",
                source="tables/data.csv",
            ),
            *([Prose(servoing_prose.counts(results))] if results.simulated else []),
        ),
        simulated=results.simulated,
    )


def claims(results: ServoingResults) -> Section:
    """The dissertation's statements beside what is found, and the departures."""
    return Section(
        "Statements of the dissertation",
        (
            Table(
                claims_frame(servoing_claims(results)),
                "What the dissertation states, or this project set out to reach, and what is found here. "
                "Numbers in brackets are 95 % intervals over seeds, of paired differences where there are "
                "any; they cover initial weights and batches only. In closed loops they are Wilson "
                "intervals over trials.",
                headings={"found": "found here", "holds": "holds here"},
            ),
            Table(departures(results), "Where this departs from the text, and why."),
        ),
        simulated=results.simulated,
    )


def contact_points(results: ServoingResults, sizes: Sizes) -> Section:
    """Estimated against true contact points; only of simulated demonstrations."""
    return Section(
        "Point of contact",
        (
            Prose(servoing_prose.contact_point(results)),
            beside(
                "contact",
                sizes,
                "Left: from where the skin is touched to where the estimate is, means over squares of "
                f"{SQUARE_MM:g} mm; grey: electrodes. Right: share of pressed samples whose "
                "error is below; dashed: 1 mm.",
                "Arrows over the flat skin, and a cumulative curve of errors.",
            ),
        ),
        simulated=True,
    )


def latent_space(results: ServoingResults, sizes: Sizes) -> Section:
    """II.4.2 and II.4.3, figure II.3."""
    table = servoing_tables.latent(results)
    meant = {
        name: [
            f"{mean:.4f}\N{NO-BREAK SPACE}±\N{NO-BREAK SPACE}{half:.4f}"
            for mean, half in zip(table[name], table[f"{name}_half"], strict=True)
        ]
        for name in ("reconstruction", "distances", "pressure")
    }
    worst = {f"{name}_worst": "worst seed" for name in ("reconstruction", "distances")}
    shown = [name for name in table if name in {**LATENT_COLUMNS, **worst}]
    return Section(
        "Latent space",
        (
            Prose(servoing_prose.latent(results)),
            beside(
                "map",
                sizes,
                "Figure II.3: every sample on the latent map and where it touches the skin, by the "
                "electrode whose reading fell most; numbers of electrodes at the middle of their samples. "
                "First seed with structure; the map is turned and mirrored onto the skin, since its loss "
                "knows distances only.",
                "Two scatter plots of coloured regions with electrode numbers.",
            ),
            Prose(servoing_prose.figure_map()),
            Table(
                table.assign(**meant)[["space", "split", *shown]],
                f"NMSE per split: mean over seeds ± half of its 95 % interval, worst seed. Map distances: "
                f"{results.learned.evaluation_pairs} random pairs of each split against geodesics. Without "
                "structure neither distances nor pressure are asked for.",
                formats=dict.fromkeys(shown, ".4f"),
                headings=LATENT_COLUMNS | worst,
                source="tables/latent.csv",
            ),
            beside(
                "curve",
                sizes,
                "Errors on the test split while training, with structure: means and 95 % intervals over "
                "seeds. Dotted: published bounds of reconstruction and map distances.",
                "Three panels of falling curves over steps of training.",
            ),
            Prose(servoing_prose.curve(results)),
        ),
        simulated=results.simulated,
    )


def forward_models(results: ServoingResults, sizes: Sizes) -> Section:
    """Figure II.4."""
    return Section(
        "Forward models",
        (
            Prose(servoing_prose.tested(results)),
            beside(
                "forward",
                sizes,
                "Figure II.4: NMSE of chained predictions, meant over latent dimensions, with 95 % intervals "
                f"over seeds. Grey line: {TEST_CHAIN} steps, the dissertation's test. Below: the same over "
                "the NMSE of the prediction that nothing moves.",
                "Six panels of curves over the number of steps.",
            ),
            Prose(servoing_prose.forward(results)),
            Table(
                servoing_tables.forward_at_test(results),
                f"NMSE at {TEST_CHAIN} steps, means over seeds, and relative to the prediction that nothing "
                "moves.",
                formats={
                    "structure": ".3f",
                    "none": ".3f",
                    "structure_relative": ".2f",
                    "none_relative": ".2f",
                },
                headings={
                    "none": "no structure",
                    "structure_relative": "structure, relative",
                    "none_relative": "no structure, relative",
                },
                source="tables/forward.csv",
            ),
        ),
        simulated=results.simulated,
    )


def inverse_models(results: ServoingResults, sizes: Sizes) -> Section:
    """Figure II.5."""
    columns = [f"{name}{part}" for name in COMPARISONS for part in ("", "_half", "_linear", "_angular")]
    headings = {name: words for name, words in COMPARISONS.items()}
    for name in COMPARISONS:
        headings |= {f"{name}_half": "±", f"{name}_linear": "linear", f"{name}_angular": "angular"}
    blocks: tuple[Block, ...] = (
        beside(
            "directions",
            sizes,
            "Figure II.5: cosine distance, weighted by the length of the true action, mean of linear and "
            "angular velocity. LL: locally linear, NG: negative gradient, NJ: network's Jacobian. Left: "
            "actions asked to reach what the forward model predicts for the true action; middle: to reach "
            "the latent state that followed; right: one against the other.",
            "Six panels of bars for three inverse models.",
        ),
        Prose(servoing_prose.directions(results)),
        Prose(servoing_prose.settled(results)),
        Table(
            servoing_tables.directions(results),
            "The same in numbers: means over seeds, half of the 95 % interval, and both parts.",
            formats=dict.fromkeys(columns, ".3f"),
            headings=headings | {"loss": "its loss"},
            source="tables/directions.csv",
            folded=True,
        ),
    )
    return Section("Inverse models", blocks, simulated=results.simulated)
