"""The sections of the dynamics page."""

from matplotlib.figure import Figure as Picture

from structlearn.reporting.page import Block, Prose, Section, Sizes, Table, beside
from structlearn.rigid_body.model_names import NAMES
from structlearn.testbeds.dynamics.page import (
    dynamics_body_figures,
    dynamics_figures,
    dynamics_prose,
    dynamics_tables,
)
from structlearn.testbeds.dynamics.page.dynamics_claims import claims_frame, dynamics_claims
from structlearn.testbeds.dynamics.page.dynamics_departures import departures
from structlearn.testbeds.dynamics.page.dynamics_results import ROBOT, DynamicsResults
from structlearn.testbeds.dynamics.page.dynamics_tables import HERE

SCORE_HEADINGS = {
    "source": "",
    "sine_position": "sines, q",
    "sine_velocity": "q̇",
    "reach_position": "reaches, x",
    "reach_velocity": "ẋ",
    "nmse": "NMSE on the log",
}

DETAILED = "cov"
"""Structure whose learned bodies are listed."""


def pictures(results: DynamicsResults) -> dict[str, Picture]:
    """All figures of the page by name."""
    return dynamics_figures.pictures(results) | dynamics_body_figures.pictures(results)


def overview(results: DynamicsResults) -> Section:
    """What is learned from what, and what is simulated."""
    return Section(
        "What is learned",
        (
            Prose(dynamics_prose.what(results)),
            Prose(dynamics_prose.robot(results)),
            Prose(dynamics_prose.other_arms()),
        ),
        simulated=True,
    )


def claims(results: DynamicsResults) -> Section:
    """The dissertation's statements beside what is found, and the departures."""
    return Section(
        "Statements of the dissertation",
        (
            Table(
                claims_frame(dynamics_claims(results)),
                "What the dissertation states, or this project set out to reach, and what is found here; "
                f"intervals are over {results.training.seeds} seeds. “MLP, scaled” is listed, but no model "
                "of the dissertation and does not count.",
                headings={"found": "found here", "holds": "holds here"},
            ),
            Table(departures(results), "Where this departs from the text, and why."),
        ),
        simulated=True,
    )


def agreement(results: DynamicsResults) -> Section:
    """Our dynamics beside Pinocchio's."""
    columns = ("recursion_n_m", "regressor_n_m", "compiled_n_m")
    return Section(
        "Agreement with Pinocchio",
        (
            Prose(dynamics_prose.agreement(results)),
            Table(
                results.agreement,
                "Largest torque, and largest differences from Pinocchio over joints and states, in N m.",
                formats={"largest_n_m": ".0f"} | dict.fromkeys(columns, ".1e"),
                headings={
                    "largest_n_m": "largest torque",
                    "recursion_n_m": "recursion",
                    "regressor_n_m": "regressor",
                    "compiled_n_m": "compiled",
                },
                source="tables/agreement.csv",
            ),
        ),
    )


def training(results: DynamicsResults, sizes: Sizes) -> Section:
    """Epochs to the threshold."""
    return Section(
        "How fast models learn",
        (
            Prose(dynamics_prose.losses(results)),
            beside(
                "training",
                sizes,
                "NMSE on the motion over the epochs, mean over joints and geometric mean over seeds, with "
                "their range; a model that is good enough on every joint (dashed: its threshold) is done, "
                "and training ends with the last one.",
                "Falling curves of ten models in two panels, one per loss, on logarithmic axes.",
            ),
            Table(
                dynamics_tables.epochs(results),
                "Epochs until every joint is good enough, mean ± std over the seeds that got there.",
                headings={
                    "raw": "raw loss",
                    "raw_but_last": "but for the last joint",
                    "normalised": "normalised loss",
                    "plain": "raw loss, plain Adam",
                },
                source="tables/epochs.csv",
            ),
        ),
        simulated=True,
    )


def tracking(results: DynamicsResults, sizes: Sizes) -> Section:
    """Table III.1."""
    table = dynamics_tables.simulation(results)
    return Section(
        "Tracking with learned models",
        (
            Prose(dynamics_prose.tracking(results)),
            Table(
                table,
                "Table III.1: epochs to the threshold, and NMSE of positions and velocities, along sines in "
                "the joints and in reaches of the tool, mean ± std over seeds; runs that were stopped.",
                headings=SCORE_HEADINGS,
                strong=_here(table),
                source="tables/simulation.csv",
            ),
            beside(
                "tracking",
                sizes,
                "Velocity error in reaches, a dot per seed.",
                "Dots of ten models on logarithmic axes, one panel per robot.",
            ),
            beside(
                "reaches",
                sizes,
                "The reaches of the first seed: how far the tool is off, and how fast it is. A curve that "
                "ends was stopped.",
                "Distances and speeds over time, one column per robot.",
            ),
        ),
        simulated=True,
    )


def online(results: DynamicsResults, sizes: Sizes) -> Section:
    """Figure III.2."""
    table = dynamics_tables.online(results)
    headings = {f"final_{loss}": f"{loss} loss: after one pass" for loss in results.learning_online.losses}
    headings |= {f"course_{loss}": "mean of the course" for loss in results.learning_online.losses}
    return Section(
        "Online learning",
        (
            Prose(dynamics_prose.online(results)),
            beside(
                "online",
                sizes,
                "As figure III.2: NMSE on the whole motion over the batches, mean over joints and geometric "
                "mean over seeds, with their range.",
                "Curves of eight models in two panels, one per loss, on a logarithmic axis.",
            ),
            Table(
                table,
                "NMSE on the whole motion: in the end, and the geometric mean over all batches.",
                formats=dict.fromkeys(headings, ".2g"),
                headings=headings,
                source="tables/online.csv",
            ),
        ),
        simulated=True,
    )


def bodies(results: DynamicsResults, sizes: Sizes) -> Section:
    """What was learned beside the truth."""
    return Section(
        "Learned bodies",
        (
            Prose(dynamics_prose.bodies_found(results)),
            beside(
                "bodies",
                sizes,
                "Learned over true values, first seed: base parameters, which torques show, and masses, "
                "which they show in part.",
                "Two scatter plots of five structures around a diagonal.",
            ),
            Table(
                dynamics_tables.bodies(results),
                "Learned links of all seeds: how many meet the conditions on a body that can exist.",
                headings=dynamics_tables.BODIES | {"possible": "all three"},
                source="tables/bodies.csv",
            ),
            Table(
                dynamics_tables.base_errors(results),
                "Median relative error of what was learned.",
                formats={"base": ".1%", "mass": ".1%"},
                headings={"base": "base parameters", "mass": "masses"},
                source="tables/base_errors.csv",
            ),
            Table(
                dynamics_tables.links(results, DETAILED),
                f"Links of {NAMES[DETAILED]}, mean ± std over seeds; moment: the largest principal one.",
                formats={"true_mass_kg": ".2f", "true_moment_kg_m2": ".4f"},
                headings={
                    "true_mass_kg": "true mass (kg)",
                    "mass_kg": "learned",
                    "centre_m": "centre off by (m)",
                    "true_moment_kg_m2": "true moment (kg m²)",
                    "moment_kg_m2": "learned",
                },
                source="tables/links.csv",
            ),
            Table(
                dynamics_tables.base_parameters(results, DETAILED),
                f"Base parameters of {NAMES[DETAILED]}; m mass, h first moment, I inertia about the joint's "
                "origin.",
                formats=dict.fromkeys(("truth", "learned", "std"), ".4f"),
                source="tables/base_parameters.csv",
                folded=True,
            ),
        ),
        simulated=True,
    )


def robot(results: DynamicsResults, sizes: Sizes) -> Section:
    """Table III.2, and friction."""
    errors = dynamics_tables.robot_errors(results)
    joints = [name for name in errors if name.startswith("joint_")]
    blocks: list[Block] = [
        Prose(dynamics_prose.robot_learning(results)),
        Table(
            errors,
            "NMSE on the robot's log per joint, mean over seeds. Bold: models that did not learn.",
            formats=dict.fromkeys([*joints, "mean"], ".3f"),
            headings={name: name.replace("_", " ") for name in joints},
            strong=dynamics_tables.best_of_robot(results),
            source="tables/robot_errors.csv",
        ),
    ]
    if results.tracked(ROBOT):
        table = dynamics_tables.robot(results)
        blocks += [
            Table(
                table,
                "Table III.2: the dissertation's real robot beside the stand-in.",
                headings=SCORE_HEADINGS,
                strong=_here(table),
                source="tables/robot.csv",
            ),
            Prose(dynamics_prose.robot_tracking(results)),
        ]
    blocks += [
        beside(
            "friction",
            sizes,
            "Torques of the log without those of the learned links (Cov + Coulomb), over the joint's speed, "
            "and the friction that was learned with them.",
            "Four clouds of points that jump at speed zero, with a curve through each.",
        ),
        Prose(dynamics_prose.friction(results)),
        Table(
            dynamics_tables.friction(results),
            "Friction of Cov + Coulomb, viscous in N m s/rad, Coulomb in N m; learned: mean ± std of seeds.",
            formats={"true_viscous": ".3f", "true_coulomb": ".3f"},
            headings={
                "true_viscous": "true viscous",
                "viscous": "learned",
                "true_coulomb": "true Coulomb",
                "coulomb": "learned",
            },
            source="tables/friction.csv",
        ),
    ]
    return Section("A robot with friction", tuple(blocks), simulated=results.stand_in is not None)


def payload(results: DynamicsResults, sizes: Sizes) -> Section:
    """A payload that is learned online."""
    return Section(
        "Beyond: a payload picked up on the way",
        (
            Prose(dynamics_prose.payload(results)),
            beside(
                "payload",
                sizes,
                "What the last link has gained, and errors on each batch before it is learned from.",
                "A mass and a moment that jump from zero to the right value, and two curves of errors.",
            ),
        ),
        simulated=True,
    )


def _here(table) -> frozenset[int]:
    return frozenset(place for place, source in enumerate(table["source"]) if source == HERE)
