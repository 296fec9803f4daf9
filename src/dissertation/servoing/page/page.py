"""The page of the servoing testbed: its tables, and names for its template."""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from dissertation.evidence.claims import judge, read_claims
from dissertation.evidence.judged_page import JudgedDocument
from dissertation.evidence.studies import Study, rests_on
from dissertation.servoing import names
from dissertation.servoing.files import MADE_BY
from dissertation.servoing.names import LATENT_NAMES, SKIN_NAMES, TARGET_NAMES
from dissertation.servoing.page.findings import PEOPLE_STUDY, TEST_CHAIN
from dissertation.servoing.page.shown import SQUARE_MM, Shown
from dissertation.servoing.protocol.results import OWN, controller_keys, keyed, prediction_errors
from dissertation.servoing.protocol.servo_scores import success_rates
from dissertation.simulation.individuals import differences
from structlearn.core.params import read_values
from structlearn.reporting.document import Source, Table
from structlearn.reporting.evidence import Evidence, clustered_share, geometric_mean, mean
from structlearn.reporting.findings import Findings
from structlearn.tactile.touch_dataset import OTHER, ROTATION, SPLITS, TRANSLATION

HERE = Path(__file__).parent
PUBLISHED = read_values(HERE / "published.yaml")  # numbers as the dissertation prints them

MOTIONS = {"rotation": ROTATION, "translation": TRANSLATION, "any motion": OTHER}
CONTROLLER = list(controller_keys(names.OURS))

LOOP_COLUMNS = {
    "rate": ("reached", ".3f"),
    "low": ("from", ".3f"),
    "high": ("to", ".3f"),
    "reach_s": ("time (s)", ".1f"),
    "path_ratio": ("path", ".2f"),
    "lifted": ("in air", ""),
    "off_skin": ("off skin", ""),
    "rotation": ("rotation", ".2f"),
    "translation": ("translation", ".2f"),
    "mixed": ("mixed", ".2f"),
    "position_error_mm": ("off (mm)", ".2f"),
    "pressure_error": ("pressure", ".3f"),
}
"""Heading and number format of each closed-loop column."""


def document(shown: Shown, find: Findings, study: Study | None) -> JudgedDocument:
    """Page with its tables and verdicts; figures come from `figures.drawings`."""
    facts = {
        "published": PUBLISHED,
        "shown": shown,
        "chosen": shown.chosen,
        "names": names,
        "found": find,
        "untested": read_values(HERE / "untested.yaml"),
        "tested": _test_chains(shown),
        "test_chain": TEST_CHAIN,
        "square_mm": SQUARE_MM,
    }
    return JudgedDocument(
        template="servoing.html.jinja",
        package=__package__,
        stage="servoing_report",
        facts=facts,
        tables=tables(shown),
        judged=judge(read_claims(HERE / "claims.yaml"), find, facts),
        sources={name: Source(*made) for name, made in MADE_BY.items()},
        parameters=shown.chosen,
        recordings="../rerun/servoing",
        simulated=True,
        basis=rests_on(PEOPLE_STUDY, study),
    )


def tables(shown: Shown) -> dict[str, Table]:
    """All tables, keyed by name."""
    loops = loop_table(shown.trials).replace({"skin": SKIN_NAMES})
    own = loops["skin"] == OWN
    return {
        "data": Table(_data(shown)),
        "differences": _rounded(_differences(shown), ".3g"),
        "latent": _rounded(latent_table(shown.models["latent"]), ".4f", LATENT_NAMES),
        "forward": _rounded(forward_table(shown), ".3f"),
        "directions": _rounded(direction_table(shown), ".3f", TARGET_NAMES),
        "other_skins": _rounded(skin_table(shown), ".4f", LATENT_NAMES),
        "other_skin_loops": _loops(loops[~own]),
        "loops": _loops(loops[own].drop(columns="skin")),
    }


def latent_table(latent: pd.DataFrame) -> pd.DataFrame:
    """NMSE by `space` and `split`: geometric mean over seeds of each column, and its worst seed."""
    groups = keyed(latent).groupby(["space", "split"], sort=False)[list(LATENT_NAMES)]
    averages = groups.agg(lambda seeds: geometric_mean(seeds).value)
    return averages.join(groups.max().add_suffix("_worst")).reset_index()


def forward_table(shown: Shown) -> pd.DataFrame:
    """NMSE by model, space and steps (figure II.4): geometric mean over seeds with its 95 % interval.

    `relative` is divided by the error of "nothing moves"; its parts and decoded errors are averaged alike.
    """
    keys = shown.predictions.index.names
    parts = prediction_errors(shown.models).groupby(keys)[["plane", "third", "electrodes", "pressure"]]
    table = _over_seeds(shown.predictions, geometric_mean, "nmse")
    table["relative"] = np.exp(np.log(shown.relative).mean(axis=1))
    return table.join(parts.agg(lambda seeds: geometric_mean(seeds).value)).reset_index()


def direction_table(shown: Shown) -> pd.DataFrame:
    """Cosine distance by inverse model, loss and space (figure II.5): mean over seeds for each target.

    Also the 95 % interval for the state that followed, and its parts, linear and angular velocity.
    """
    keys = ["space", "model", "loss"]
    directions = keyed(shown.models["directions"])
    averages = directions.pivot_table("distance", keys, "target")[list(TARGET_NAMES)]
    ends = _over_seeds(shown.directions.xs("followed", level="target"), mean, "").drop(columns="")
    followed = directions.query("target == 'followed'")
    parts = followed.pivot_table("distance", keys, "part").rename(columns=names.PART_NAMES)
    return averages.join(ends).join(parts).reset_index()


def skin_table(shown: Shown) -> pd.DataFrame:
    """Errors of models of other skins on test contacts, with structure: means over seeds.

    Columns: `skin`; those of `LATENT_NAMES`; cosine distance of each inverse model, trained with its loss,
    for the latent state that followed, linear and angular.
    """
    latent, directions = shown.other_skins["latent"], keyed(shown.other_skins["directions"])
    spaces = latent[latent["structure"] & (latent["split"] == "test")]
    own = directions.query("space == 'structure' and model == loss and target == 'followed'")
    column = own["model"] + "_" + own["part"].map(names.PART_NAMES)
    distances = own.assign(column=column).pivot_table("distance", "skin", "column")
    errors = spaces.groupby("skin", sort=False)[list(LATENT_NAMES)].mean()
    return errors.join(distances).rename(index=SKIN_NAMES).reset_index()


def loop_table(trials: pd.DataFrame) -> pd.DataFrame:
    """One row per controller and skin: `success_rates` with interval, rates by motion, median errors."""
    keys = ["skin", *CONTROLLER]
    groups = trials.groupby(keys, sort=False)
    table = success_rates(trials, keys).set_index(keys)
    seeds = trials.groupby([*keys, "seed"], sort=False)["success"].agg(["sum", "size"])
    found = [clustered_share(*one.to_numpy().T) for _, one in seeds.groupby(keys, sort=False)]
    table = table.assign(low=[one.low for one in found], high=[one.high for one in found])
    motions = trials.pivot_table("success", keys, "target")
    errors = groups[["position_error_mm", "pressure_error"]].median()
    return table.join(motions).join(errors).reset_index()


def _over_seeds(values: pd.DataFrame, average: Callable[[np.ndarray], Evidence], name: str) -> pd.DataFrame:
    """Average of each row over seeds (columns) as a column `name`, with `low` and `high`."""
    found = [average(seeds) for seeds in values.to_numpy()]
    columns = {name: [one.value for one in found], "low": [one.low for one in found]}
    return pd.DataFrame(columns | {"high": [one.high for one in found]}, values.index)


def _rounded(frame: pd.DataFrame, number_format: str, headings: Mapping[str, str] | None = None) -> Table:
    return Table(frame, dict.fromkeys(frame.select_dtypes("floating"), number_format), headings or {})


def _loops(frame: pd.DataFrame) -> Table:
    """Table of closed-loop scores, with the dissertation's controller and ours in bold."""
    bold = [controller_keys(one) for one in (names.AS_PUBLISHED, names.OURS)]
    strong = frozenset(row for row, its in enumerate(frame[CONTROLLER].to_dict("records")) if its in bold)
    frame = frame.reset_index(drop=True).replace({"controller": names.FORM_NAMES})
    frame = frame[[*frame.columns[: frame.columns.get_loc("trials")], "trials", "successes", *LOOP_COLUMNS]]
    headings, formats = ({name: both[place] for name, both in LOOP_COLUMNS.items()} for place in (0, 1))
    return Table(frame, formats, headings, strong)


def _data(shown: Shown) -> pd.DataFrame:
    """Sizes of the data set: columns `quantity`, `dissertation`, `here`."""
    dataset, person, geodesics = shown.dataset, shown.chosen["toucher"], shown.chosen["geodesics"]
    by_motion = [dataset.motion == motion for motion in (ROTATION, TRANSLATION)]
    by_split = [dataset.split == split for split in SPLITS.values()]
    contacts, contacts_by_split = (
        " | ".join(str(len(np.unique(dataset.contact[part]))) for part in parts)
        for parts in (by_motion, by_split)
    )
    bin_size = min(geodesics.bin_size, len(dataset))
    bins = len(dataset) // geodesics.bin_size
    bins = bins if geodesics.bins is None else min(bins, geodesics.bins)
    counts = " | ".join(f"{person.areas} areas x {one}" for one in (person.rotations, person.translations))
    samples = " | ".join(str(part.sum()) for part in by_motion)
    shares = " | ".join(f"{100 * part.mean():.1f}" for part in by_split)
    printed = f"{PUBLISHED['samples'] // PUBLISHED['bin_size']} of {PUBLISHED['bin_size']}"
    rows = [
        ("demonstrations, rotation | translation", PUBLISHED["demonstrations"], counts),
        ("contacts, rotation | translation", PUBLISHED["contacts"], contacts),
        ("samples, rotation | translation", "half and half", samples),
        ("samples of touch", str(PUBLISHED["samples"]), str(len(dataset))),
        ("pairs of successive actions, at five rates", str(PUBLISHED["pairs"]), str(shown.pairs)),
        ("bins of samples for geodesics", printed, f"{bins} of {bin_size}"),
        ("training | validation | test, % of the samples", PUBLISHED["splits"], shares),
        ("… contacts", "not said", contacts_by_split),
    ]
    return pd.DataFrame(rows, columns=["quantity", "dissertation", "here"])


def _differences(shown: Shown) -> pd.DataFrame:
    """What differs between people and between their sensors, see `individuals.differences`."""
    fingers = shown.chosen["touch_finger"].with_electrodes_of(shown.chosen["testbed.touch"])
    populations = {"person": shown.chosen["toucher"], "sensor": fingers}
    parts = [differences(one).assign(of=name) for name, one in populations.items()]
    return pd.concat(parts, ignore_index=True)[["of", *parts[0].columns.drop("of")]]


def _test_chains(shown: Shown) -> list[tuple[str, int, int]]:
    """Number of test chains and contacts of the forward and inverse models, by motion."""
    first, dataset = shown.tested.rows[:, 0], shown.dataset
    rows = []
    for name, number in MOTIONS.items():
        if number in dataset.motion:
            its = first[dataset.motion[first] == number]
            rows.append((name, len(its), len(np.unique(dataset.contact[its]))))
    return rows
