"""The page of the dynamics testbed: its sections in order."""

from collections.abc import Mapping, Sequence

from structlearn.ground.params import Parameters
from structlearn.reporting.page import HOW_TO_OPEN, Block, KeyNumber, Link, Links, Page, Prose, Section, Sizes
from structlearn.reporting.parameter_table import parameter_table
from structlearn.reporting.prose import rounded
from structlearn.rigid_body.model_names import COULOMB, DEFAULT, GROUND_TRUTH, model_name
from structlearn.testbeds.dynamics.page import dynamics_sections
from structlearn.testbeds.dynamics.page.dynamics_results import IDEAL, DynamicsResults, metrics

LEAD = (
    "Inverse dynamics of an arm, learned from its motion: with what is known of rigid bodies built into the "
    "model, or without. All motions on this page are simulated unless a log of your own takes the robot's "
    "place. Dissertation, chapter III."
)


def dynamics_page(
    results: DynamicsResults,
    sizes: Sizes,
    parameters: Mapping[str, Parameters],
    recordings: Sequence[Link] = (),
) -> Page:
    """The page; figures are expected as `figures/NAME.png`, tables as `tables/NAME.csv`.

    Args:
        results: what to show.
        sizes: of the figures of `dynamics_sections.pictures`.
        parameters: by their key in `params.yaml`.
        recordings: links to .rrd files.
    """
    return Page(
        title="Dynamics: learning with physical structure",
        lead=LEAD,
        key_numbers=_key_numbers(results),
        sections=(
            dynamics_sections.overview(results),
            dynamics_sections.claims(results),
            dynamics_sections.agreement(results),
            dynamics_sections.training(results, sizes),
            dynamics_sections.tracking(results, sizes),
            dynamics_sections.online(results, sizes),
            dynamics_sections.bodies(results, sizes),
            dynamics_sections.robot(results, sizes),
            dynamics_sections.payload(results, sizes),
            _files(parameters, recordings),
        ),
        simulated=results.stand_in is not None,
        back=Link("../index.html", "All testbeds"),
    )


def _key_numbers(results: DynamicsResults) -> tuple[KeyNumber, ...]:
    """Of the models that were run."""
    values, numbers = metrics(results), []
    if results.strict:
        numbers.append(
            KeyNumber(
                _side_by_side([values[f"epochs_{model}"] for model in results.strict], ".1f"),
                f"epochs until {_names(results.strict)} are good enough on every joint, raw loss",
            )
        )
    if shown := [model for model in ("cov", "mlp") if model in results.tracked(IDEAL)]:
        truth = rounded(results.velocity(GROUND_TRUTH).mean(), ".2g")
        numbers.append(
            KeyNumber(
                _side_by_side([results.velocity(model).mean() for model in shown], ".2g"),
                f"velocity NMSE in unseen reaches with {_names(shown)}; with the ground truth {truth}",
            )
        )
    if found := [model for model in ("cov", f"cov{COULOMB}") if model in results.robot_models]:
        ratios = [results.robot_error(DEFAULT) / results.robot_error(model) for model in found]
        numbers.append(
            KeyNumber(
                f"{_side_by_side(ratios, '.0f')} times",
                f"smaller error than the default model's on the robot's log: {_names(found)} friction",
            )
        )
    numbers.append(KeyNumber(f"{rounded(values['rnea_max_error_nm'], '.0e')} N m", "from Pinocchio"))
    return tuple(numbers)


def _side_by_side(numbers: Sequence[float], number_format: str) -> str:
    return " | ".join(rounded(number, number_format) for number in numbers)


def _names(models: Sequence[str]) -> str:
    return " | ".join(map(model_name, models))


def _files(parameters: Mapping[str, Parameters], recordings: Sequence[Link]) -> Section:
    blocks: list[Block] = []
    if recordings:
        blocks += [Prose(HOW_TO_OPEN), Links(tuple(recordings))]
    blocks += [
        Prose("The numbers on this page are in these files or follow from `data/dynamics`."),
        Links(
            (
                Link("metrics.json", "metrics.json", "the key figures, for `dvc metrics show`"),
                Link("tables/scores.csv", "tables/scores.csv", "every tracked run"),
                Link("tables/outcomes.csv", "tables/outcomes.csv", "every training"),
                Link("tables/payload.csv", "tables/payload.csv", "the payload, batch by batch"),
            )
        ),
        parameter_table(parameters),
    ]
    return Section("Files and parameters", tuple(blocks))
