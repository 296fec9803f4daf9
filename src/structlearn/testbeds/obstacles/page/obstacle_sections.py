"""The sections of the obstacle page."""

import pandas as pd
from matplotlib.figure import Figure as Picture

from structlearn.reporting.page import Prose, Section, Sizes, Table, beside
from structlearn.testbeds.obstacles.page import (
    obstacle_figures,
    obstacle_path_figures,
    obstacle_prose,
    obstacle_tables,
)
from structlearn.testbeds.obstacles.page.obstacle_claims import claims_frame, obstacle_claims
from structlearn.testbeds.obstacles.page.obstacle_departures import departures
from structlearn.testbeds.obstacles.page.obstacle_published import LARGEST_NMSE
from structlearn.testbeds.obstacles.page.obstacle_results import ObstacleResults
from structlearn.testbeds.obstacles.page.obstacle_tables import SOURCES
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import LIMITED, MOVING

SUMMARY_FORMATS = {
    "goal_max": ".3f",
    "goal_mean": ".3f",
    "late_goal_max": ".3f",
    "obstacle_min": ".3f",
    "obstacle_mean": ".3f",
    "hits": ".0f",
}
SUMMARY_HEADINGS = {
    "source": "",
    "goal_max": "goal max",
    "goal_mean": "mean",
    "late_goal_max": "late max",
    "obstacle_min": "obstacle min",
    "obstacle_mean": "mean",
}
SHOWN_SHAPE = "sphere"
"""What the network learned from that is shown among unseen spheres."""


def pictures(results: ObstacleResults) -> dict[str, Picture]:
    """All figures of the page by name."""
    return {
        "example": obstacle_path_figures.example_figure(results),
        "fit": obstacle_figures.fit_figure(results),
        "people": obstacle_figures.people_figure(results),
        "unseen": obstacle_path_figures.unseen_figure(results, SHOWN_SHAPE),
        "beyond": obstacle_path_figures.beyond_figure(results),
        "distances": obstacle_figures.distances_figure(results),
    }


def demonstrations(results: ObstacleResults, sizes: Sizes) -> Section:
    """What was demonstrated, and what models make of it."""
    return Section(
        "Demonstrations",
        (
            Prose(obstacle_prose.what(results)),
            beside(
                "example",
                sizes,
                f"Setting {results.example_setting}: {results.person.count} demonstrations past each shape, "
                "the primitive without avoidance, and the models that learned all settings of the shape, "
                "with limits at the goal. Thin ends: after the prescribed time.",
                "Paths past a sphere, a cube and a cylinder from the side and from above.",
            ),
            Prose(obstacle_prose.example(results)),
        ),
        simulated=results.simulated,
    )


def claims(results: ObstacleResults) -> Section:
    """The dissertation's statements beside what is found, and the departures."""
    return Section(
        "Statements of the dissertation",
        (
            Table(
                claims_frame(obstacle_claims(results)),
                "What the dissertation states, or this project set out to reach, and what is found here on "
                "simulated demonstrations. Numbers are of unrolls with limits at the goal where nothing "
                "else is said.",
                headings={"found": "found here", "holds": "holds here"},
            ),
            Prose(obstacle_prose.members(results)),
            Table(departures(results), "Where this departs from the text, and why."),
        ),
        simulated=results.simulated,
    )


def fit(results: ObstacleResults, sizes: Sizes) -> Section:
    """Figure IV.10."""
    low = f"at most {LARGEST_NMSE:g}"
    return Section(
        "Fit per setting",
        (
            beside(
                "fit",
                sizes,
                "As figure IV.10: NMSE of the coupling term, a model for every scenario; left the network, "
                "right the model of Rai et al. The middle row is not in the dissertation: y and z alone, "
                "which act.",
                "Histograms of errors over scenarios, six panels.",
            ),
            Table(
                obstacle_tables.fit(results),
                "The same in numbers: mean NMSE over scenarios, and in how many of them it is at most that "
                "published for all.",
                formats={"train_mean": ".3f", "test_mean": ".3f"},
                headings={
                    "over": "NMSE over",
                    "train_mean": "learned from, mean",
                    "test_mean": "held out, mean",
                    "train_low": f"learned from, {low}",
                    "test_low": f"held out, {low}",
                },
                source="tables/fit.csv",
            ),
            Prose(obstacle_prose.fit(results)),
            Prose(obstacle_prose.fit_of_both(results)),
        ),
        simulated=results.simulated,
    )


def per_setting(results: ObstacleResults, sizes: Sizes) -> Section:
    """Table IV.1."""
    return Section(
        "A model per setting",
        (
            _summary(
                obstacle_tables.per_setting(results),
                f"Table IV.1: {len(results.scenarios)} scenarios, a model for each. "
                f"{obstacle_prose.DISTANCE}",
                "tables/per_setting.csv",
            ),
            Prose(obstacle_prose.per_setting(results)),
            beside(
                "people",
                sizes,
                "Closest distance to the obstacle in every scenario, over that of people (mean of their "
                "demonstrations): on the diagonal a model keeps people's distance, below the dashed line it "
                "hits. The scale is linear up to 2 radii. With limits at the goal.",
                "Scatter of closest distances against those of people, four panels.",
            ),
        ),
        simulated=results.simulated,
    )


def per_shape(results: ObstacleResults) -> Section:
    """Table IV.2."""
    table = obstacle_tables.per_shape(results)
    return Section(
        "One network per shape",
        (
            _summary(
                table,
                f"Table IV.2: one network for the {results.scene.settings} settings of a shape. NMSE is "
                "over y and z.",
                "tables/per_shape.csv",
            ),
            Prose(obstacle_prose.per_shape(results)),
        ),
        simulated=results.simulated,
    )


def unseen(results: ObstacleResults, sizes: Sizes) -> Section:
    """Table IV.3."""
    return Section(
        "Unseen obstacles",
        (
            _summary(
                obstacle_tables.unseen(results),
                "Table IV.3: unseen spheres; networks by the shape that they learned from. The "
                "dissertation's rows are as printed: there the largest goal distances of networks are below "
                "the mean ones, and the smallest obstacle distance of the sphere's is that without "
                "avoidance.",
                "tables/unseen.csv",
            ),
            Prose(obstacle_prose.unseen(results)),
            beside(
                "unseen",
                sizes,
                f"All unseen spheres, and the paths past each of them of the network that learned from a "
                f"{SHOWN_SHAPE} in all settings.",
                "Grid of circles along a reach with arcs of paths above them.",
            ),
        ),
        simulated=results.simulated,
    )


def goals(results: ObstacleResults) -> Section:
    """Both kinds of post-processing side by side."""
    table = obstacle_tables.limits(results)
    metres = ("goal_text", "goal_limited", "late_goal_text", "late_goal_limited", "excursion")
    return Section(
        "Reaching the goal",
        (
            Prose(obstacle_prose.goals(results, table)),
            Prose(obstacle_prose.excursions(results, table)),
            Table(
                table,
                "The rules of the text | with limits. Goal distances in m, the largest of all unrolls; "
                "between: with limits, after the prescribed time. Restrained: share of the samples at which "
                "the limits changed the coupling term.",
                formats=dict.fromkeys(metres, ".3f") | {"restrained": ".1%"},
                headings={
                    "hits_text": "hits, text",
                    "hits_limited": "limits",
                    "goal_text": "goal, text",
                    "goal_limited": "limits",
                    "late_goal_text": "late, text",
                    "late_goal_limited": "limits",
                    "excursion": "between",
                },
                source="tables/limits.csv",
            ),
        ),
        simulated=results.simulated,
    )


def all_shapes(results: ObstacleResults) -> Section:
    """One network for all shapes, and the phase-modulated network."""
    return Section(
        "Beyond: one network for all shapes, and phase modulation",
        (
            Prose(obstacle_prose.all_shapes(results)),
            Table(
                obstacle_tables.all_shapes(results),
                "Held-out NMSE per local axis, and unrolls past the trained obstacles with limits at the "
                "goal.",
                formats={name: ".3f" for name in ("nmse_x", "nmse_y", "nmse_z", "obstacle_min", "goal_max")},
                headings={
                    "model": "model, learned from",
                    "nmse_x": "x",
                    "nmse_y": "y",
                    "nmse_z": "z",
                    "obstacle_min": "obstacle, min",
                    "goal_max": "goal, max (m)",
                },
                source="tables/all_shapes.csv",
            ),
        ),
        simulated=results.simulated,
    )


def beyond(results: ObstacleResults, sizes: Sizes) -> Section:
    """Moving spheres, two spheres, and a moving goal."""
    table = obstacle_tables.hits(results)
    speeds = {name: f"{name.split('_')[1]} m/s" for name in table.columns if name.startswith(MOVING)}
    detours = {
        "detour_unseen": "detour",
        "detour_moving": "moving",
        "detour_pair": "two",
    }
    return Section(
        "Beyond: obstacles and goals that move",
        (
            Prose(obstacle_prose.beyond(results)),
            Prose(obstacle_prose.detours(results)),
            beside(
                "beyond",
                sizes,
                "The network of all shapes where the reach without avoidance comes closest. The moving "
                "sphere is drawn at five times, the later the darker, with a dot where the hand is then; "
                "crosses: the goal before (grey) and after it moved. Thin: after the prescribed time.",
                "Paths past a moving sphere, past two spheres and to a goal that moves, from two sides.",
            ),
            beside(
                "distances",
                sizes,
                "Closest distance of every unroll, with limits at the goal; red: hits, counted at the right. "
                f"Farther than {obstacle_figures.FARTHEST:g} radii is drawn there.",
                "Strips of dots per model in four situations, with numbers of hits.",
            ),
            Table(
                table,
                "The same in numbers: hits on unseen spheres, on moving ones by speed, on two at once, and "
                "while the goal moves; the closest distance of all these in radii; detours in m past "
                "unseen, moving and two spheres: the largest distance from the reach without avoidance, "
                "meant over situations.",
                formats={"closest": ".3f"} | dict.fromkeys(detours, ".2f"),
                headings={"pair": "two", "goal_change": "goal"} | speeds | detours,
                source="tables/hits.csv",
            ),
        ),
        simulated=results.simulated,
    )


def _summary(frame: pd.DataFrame, caption: str, source: str) -> Table:
    """A table of the dissertation beside ours; what acts with limits is in bold."""
    strong = frozenset(row for row, name in enumerate(frame["source"]) if name == SOURCES[LIMITED])
    fits = {"nmse_train": "NMSE train", "nmse_test": "test"}
    return Table(
        frame,
        caption,
        formats=SUMMARY_FORMATS | dict.fromkeys(fits, ".3f"),
        headings=SUMMARY_HEADINGS | fits,
        strong=strong,
        source=source,
    )
