"""The overview of the testbeds: a card for each, made from its metrics."""

from collections.abc import Sequence
from dataclasses import dataclass

from structlearn.ground.artefacts import Metrics
from structlearn.reporting.page import (
    HOW_TO_OPEN,
    Figure,
    KeyNumber,
    KeyNumbers,
    Link,
    Links,
    Page,
    Prose,
    Section,
)
from structlearn.reporting.prose import rounded


@dataclass(frozen=True)
class Number:
    """A key number of a card.

    Attributes:
        key: in the testbed's metrics; a number that is not there is left out.
        label: what it is.
        number_format: how it is written.
        unit: written behind it.
        factor: times the value.
    """

    key: str
    label: str
    number_format: str
    unit: str = ""
    factor: float = 1.0


@dataclass(frozen=True)
class Card:
    """What the overview says about one testbed.

    Attributes:
        folder: of its report, beside the overview; it holds `index.html`, `metrics.json` and `figures`.
        title: of the card.
        text: what the testbed is about.
        picture: name of one of its figures.
        caption: of the picture.
        numbers: the key numbers.
    """

    folder: str
    title: str
    text: str
    picture: str
    caption: str
    numbers: tuple[Number, ...]


SCRAPING = Card(
    folder="scraping",
    title="Scraping: from demonstrations to feedback by touch",
    text=(
        "Demonstrations of a scraping task are cut into primitives by aligning them, the primitives are "
        "learned and executed as one movement without a jump. A board that tilts is felt through two "
        "fingers; a network learns from corrections what to do about it, and by trial what nobody has shown. "
        "Dissertation, sections IV.3, IV.5 to IV.7 and IV.9."
    ),
    picture="sequence",
    caption="The learned sequence, as demonstrated and in a new situation.",
    numbers=(
        Number("demonstrations", "demonstrations cut into primitives", "d"),
        Number("cut_error_ms_wls", "mean error of a cut point", ".0f", " ms"),
        Number("left_one_out_scrape_mean_mm", "distance from scrapes that were left out", ".1f", " mm"),
        Number("pmnn_prim2_generalization_nmse", "generalisation NMSE of feedback, primitive 2", ".2f"),
        Number(
            "cost_ratio_feedback_over_nominal_10",
            "of the cost without feedback, with it, board at 10°",
            ".0f",
            " %",
            100.0,
        ),
        Number("rl_cost_after_prim2", "cost at 10° after refinement by trial, primitive 2", ".0f", " rad"),
        Number("rl_cost_before_prim2", "before it", ".0f", " rad"),
    ),
)

OBSTACLES = Card(
    folder="obstacles",
    title="Obstacle avoidance: coupling terms from demonstrations",
    text=(
        "A reach learns how people avoid spheres, cubes and cylinders: a network turns what is near the hand "
        "into a coupling term of its primitive, past obstacles that it knows and others that it has never "
        "seen. Dissertation, section IV.8."
    ),
    picture="example",
    caption="Past the nearest obstacle of each shape: demonstrations, the reach alone, learned models.",
    numbers=(
        Number("demonstrations", "demonstrations past obstacles", "d"),
        Number("hits_per_setting", "trained scenarios hit, a network each", "d"),
        Number(
            "hits_unseen_sphere", "of 63 unseen spheres hit by the network that learned from spheres", "d"
        ),
        Number("hits_unseen_baseline", "hit without avoidance", "d"),
        Number("nmse_test_sphere", "held-out NMSE of this network, worse of y and z", ".2f"),
        Number(
            "goal_distance_max_m", "largest distance from a goal at the prescribed time", ".1f", " cm", 100.0
        ),
    ),
)

DYNAMICS = Card(
    folder="dynamics",
    title="Dynamics: learning with physical structure",
    text=(
        "An arm learns its own dynamics from motion: masses, centres of mass and inertias of bodies that can "
        "exist, beside networks that know less of physics. Then the models control it, on a stand-in for a "
        "real robot too, with friction that is learned as well. Dissertation, chapter III."
    ),
    picture="tracking",
    caption="Error of the tool's velocity in reaches that were not learned from, by model.",
    numbers=(
        Number("epochs_cov", "epochs until the model of consistent bodies is good enough", ".1f"),
        Number("ee_velocity_nmse_cov", "velocity NMSE with it in unseen reaches", ".1g"),
        Number("ee_velocity_nmse_mlp", "with a network that knows no physics", ".2g"),
        Number("robot_nmse_cov_coulomb", "NMSE on the stand-in's log, with Coulomb friction", ".3f"),
        Number("robot_nmse_default", "of the default model", ".2f"),
    ),
)

SERVOING = Card(
    folder="servoing",
    title="Tactile servoing in a learned latent space",
    text=(
        "A finger brings a contact to where it is wanted on its skin. Demonstrations of touch teach a flat "
        "map of the skin and a model of how its movement changes the contact; inverted, the model acts. "
        "Dissertation, chapter II."
    ),
    picture="map",
    caption="The latent map beside the skin; every touch by its most active electrode.",
    numbers=(
        Number("samples", "samples of touch", "d"),
        Number("reconstruction_nmse_test", "reconstruction NMSE, test contacts", ".3f"),
        Number("mds_nmse_test", "NMSE of map distances, test contacts", ".4f"),
        Number("cosine_distance_nj", "cosine distance of actions by the network's Jacobian", ".2f"),
        Number(
            "servo_success_rate",
            "of closed loops end within 1 mm and 10 % pressure",
            ".0f",
            " %",
            100.0,
        ),
    ),
)


def overview_page(cards: Sequence[tuple[Card, Metrics]]) -> Page:
    """The overview.

    Args:
        cards: every testbed with its metrics.
    """
    recorded = Section(
        "Recorded data",
        (
            Prose(
                "The same methods on public recordings of people and robots: reaches, unscrewing, scraping "
                "and sliding with tactile fingers. The pipeline `stages/recorded/dvc.yaml` makes the report."
            ),
            Links(
                (
                    Link("recorded/index.html", "Report on recorded data"),
                    Link(
                        "calibration/index.html",
                        "Simulated touch beside recorded touch",
                        "how far the simulated fingers are like the real sensor",
                    ),
                )
            ),
        ),
        link="recorded/index.html",
    )
    files = Section(
        "How to open the recordings",
        (
            Prose(
                "Recordings (`.rrd`) show demonstrations, cut points and movements in three dimensions, with "
                f"a time line. They are linked on the page of their testbed. {HOW_TO_OPEN}"
            ),
        ),
    )
    times = Section(
        "How long it takes",
        (
            Prose(
                "How long each stage took when it last ran is on a page of its own, since times differ from "
                "run to run."
            ),
            Links((Link("times/index.html", "Times of all stages"),)),
        ),
        link="times/index.html",
    )
    return Page(
        title="Learning robot control and reactive planning with structured models",
        lead=(
            "A reproduction of the dissertation of Giovanni Sutanto (USC, 2020) as a pipeline. What is "
            "simulated is made by `dvc repro`, from the demonstrations to this page."
        ),
        sections=(*[_section(card, metrics) for card, metrics in cards], recorded, files, times),
    )


def _section(card: Card, metrics: Metrics) -> Section:
    page = f"{card.folder}/index.html"
    known = [number for number in card.numbers if metrics.get(number.key) is not None]
    strip = tuple(
        KeyNumber(
            format(int(metrics[number.key]), "d") + number.unit
            if number.number_format == "d"
            else rounded(number.factor * metrics[number.key], number.number_format) + number.unit,
            number.label,
        )
        for number in known
    )
    return Section(
        card.title,
        (
            Prose(card.text),
            *([KeyNumbers(strip)] if strip else []),
            Figure(f"{card.folder}/figures/{card.picture}.png", card.caption, card.caption),
            Links((Link(page, "Report", "figures, tables, parameters and recordings"),)),
        ),
        simulated=bool(metrics.get("simulated")),
        link=page,
    )
