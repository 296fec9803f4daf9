"""The page of the servoing testbed: its tables, and names for its template."""

from collections.abc import Mapping
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from dissertation.evidence.claims import judge, read_claims
from dissertation.evidence.judged_page import JudgedDocument
from dissertation.evidence.studies import rests_on
from dissertation.servoing import names
from dissertation.servoing.files import MADE_BY
from dissertation.servoing.names import (
    COMPARISON_NAMES,
    DYNAMICS,
    LATENT_NAMES,
    PART_NAMES,
    SKIN_NAMES,
    STILL,
    STRUCTURE_NAMES,
    dynamics_name,
)
from dissertation.servoing.page.findings import (
    PEOPLE_STUDY,
    PUBLISHED,
    SQUARE_MM,
    TEST_CHAIN,
    ModelScores,
    ServoingResults,
    contact_bias,
    rate,
)
from dissertation.servoing.protocol.servo_scores import KEYS, ControllerScores, success_rates
from dissertation.servoing.protocol.servo_variants import ServoVariant
from structlearn.core.metrics import mean_interval
from structlearn.reporting.document import Source, Table
from structlearn.reporting.findings import Findings
from structlearn.tactile.latent_parameters import FORWARD_OF, STRUCTURES
from structlearn.tactile.touch_dataset import OTHER, ROTATION, SPLITS, TRANSLATION

MOTIONS = {"rotation": ROTATION, "translation": TRANSLATION, "any motion": OTHER}

PARTS = ["plane", "third", "electrodes", "pressure"]
"""Prediction errors by part of the latent state, and after decoding."""

LOOP_COLUMNS = {
    "with_loss": ("its loss", ""),
    "rate": ("reached", ".3f"),
    "low": ("from", ".3f"),
    "high": ("to", ".3f"),
    "reach_s": ("time (s)", ".1f"),
    "path_ratio": ("path", ".2f"),
    "lifted": ("in air", ""),
    "off_skin": ("off skin", ""),
    "rate_rotation": ("rotation", ".2f"),
    "rate_translation": ("translation", ".2f"),
    "rate_mixed": ("mixed", ".2f"),
    "position_error_mm": ("off (mm)", ".2f"),
    "pressure_error": ("pressure", ".3f"),
}
"""Heading and number format of each closed-loop column."""


def document(results: ServoingResults, find: Findings) -> JudgedDocument:
    """Page with its tables and verdicts; figures come from `figures.drawings`."""
    errors, shown = results.contact_errors, tables(results)
    squares = np.square(errors[["along_mm", "across_mm"]]).to_numpy().sum()
    facts = {
        "published": PUBLISHED,
        "results": results,
        "models": results.models,
        "trials": results.trials,
        "chosen": results.chosen,
        "names": names,
        "found": find,
        "tested": _test_chains(results),
        "test_chain": TEST_CHAIN,
        "square_mm": SQUARE_MM,
        "fixed_share": contact_bias(errors)["squared_mm2"].sum() / squares,
    }
    claims = read_claims(Path(__file__).with_name("claims.yaml"))
    return JudgedDocument(
        template="servoing.html.jinja",
        package=__package__,
        stage="servoing_report",
        facts=facts,
        tables=shown,
        judged=judge(claims, find, facts),
        sources={name: Source(*made) for name, made in MADE_BY.items()},
        parameters=results.chosen,
        recordings="../rerun/servoing",
        simulated=True,
        basis=rests_on(PEOPLE_STUDY, results.people.study),
    )


def tables(results: ServoingResults) -> dict[str, Table]:
    """All tables, keyed by name."""
    models = results.models
    loops = {SKIN_NAMES[name]: loop_table(one) for name, one in results.skins.items()}
    return {
        "data": Table(_data(results)),
        "latent": _rounded(latent_table(models), ".4f", LATENT_NAMES),
        "forward": _rounded(forward_table(models), ".3f"),
        "directions": _rounded(direction_table(models), ".3f", {"loss": "its loss"} | COMPARISON_NAMES),
        "other_skins": _rounded(skin_table(results), ".4f", LATENT_NAMES),
        "other_skin_loops": _loops(pd.concat(loops, names=["skin", None]).reset_index("skin")),
        "loops": _loops(loop_table(results.trials)),
    }


def latent_table(models: ModelScores) -> pd.DataFrame:
    """Latent-space errors by `space` and `split`: mean, interval half-width and worst seed of each column."""
    rows = []
    for structure, split in product(STRUCTURES, SPLITS):
        row: dict[str, object] = {"space": STRUCTURE_NAMES[structure], "split": split}
        for column in LATENT_NAMES:
            values = models.latents(column, structure, split)
            mean, half = mean_interval(values)
            row |= {column: mean, f"{column}_half": half, f"{column}_worst": values.max()}
        rows.append(row)
    return pd.DataFrame(rows)


def forward_table(models: ModelScores) -> pd.DataFrame:
    """Forward NMSE by model, space and steps (figure II.4): mean and 95 % half-width over seeds.

    `relative` is divided by the error of "nothing moves"; columns named in `PARTS` are means.
    """
    rows = []
    for kind, structure, steps in product((STILL, *DYNAMICS), STRUCTURES, models.steps):
        case = (*kind, structure, steps)
        nmse, relative = models.forwards(*case), models.relative_forwards(*case)
        parts = [models.forwards(*case, part).mean() for part in PARTS]
        keys = (dynamics_name(*kind), STRUCTURE_NAMES[structure], steps)
        rows.append((*keys, *mean_interval(nmse), *mean_interval(relative), *parts))
    columns = ["model", "space", "steps", "nmse", "half", "relative", "relative_half", *PARTS]
    return pd.DataFrame(rows, columns=columns)


def direction_table(models: ModelScores) -> pd.DataFrame:
    """Cosine distances by `inverse` model, training `loss` and `space` (figure II.5).

    For each comparison, mean and half-width over seeds for the whole action, and the mean of each part.
    """
    rows = []
    for name, loss, structure in product(FORWARD_OF, (True, False), STRUCTURES):
        row: dict[str, object] = {"inverse": name, "loss": loss, "space": STRUCTURE_NAMES[structure]}
        for comparison in COMPARISON_NAMES:
            case = (name, loss, structure, comparison)
            mean, half = mean_interval(models.cosines(*case))
            row |= {comparison: mean, f"{comparison}_half": half}
            for part, word in PART_NAMES.items():
                row[f"{comparison}_{word}"] = models.cosines(*case, part).mean()
        rows.append(row)
    return pd.DataFrame(rows)


def skin_table(results: ServoingResults) -> pd.DataFrame:
    """Mean test errors over seeds of models of other skins, with structure.

    Columns: `skin`; those of `LATENT_NAMES`; `<inverse>_linear` and `<inverse>_angular`, cosine distances of
    actions for the latent state that followed, for inverse models trained with their loss.
    """
    latent, directions = results.skin_tables["latent"], results.skin_tables["directions"]
    spaces = latent[latent["structure"] & (latent["split"] == "test")]
    own = directions["structure"] & (directions["inverse"] == directions["trained_with"])
    by_encoder = directions[own & (directions["comparison"] == "encoder")]
    by_encoder = by_encoder.assign(key=by_encoder["inverse"] + "_" + by_encoder["part"].map(PART_NAMES))
    distances = by_encoder.pivot_table("distance", "skin", "key")
    columns = [f"{inverse}_{part}" for inverse in FORWARD_OF for part in PART_NAMES.values()]
    errors = spaces.groupby("skin", sort=False)[list(LATENT_NAMES)].mean()
    return errors.join(distances[columns]).rename(index=SKIN_NAMES).reset_index()


def loop_table(scores: ControllerScores) -> pd.DataFrame:
    """One row per controller: `success_rates`, interval of the rate, rates by motion, median errors."""
    trials = scores.trials
    motions = success_rates(trials, [*KEYS, "motion"]).pivot_table("rate", KEYS, "motion")
    motions = motions[trials["motion"].unique()].add_prefix("rate_")
    errors = trials.groupby(KEYS)[["position_error_mm", "pressure_error"]].median()
    table = scores.rates.join(motions).join(errors).reset_index()
    found = [rate(scores, ServoVariant(**keys)) for keys in table[KEYS].to_dict("records")]
    place = table.columns.get_loc("rate") + 1
    table.insert(place, "low", [one.low for one in found])
    table.insert(place + 1, "high", [one.high for one in found])
    return table


def _rounded(frame: pd.DataFrame, number_format: str, headings: Mapping[str, str] | None = None) -> Table:
    return Table(frame, dict.fromkeys(frame.select_dtypes("floating"), number_format), headings or {})


def _loops(frame: pd.DataFrame) -> Table:
    """Table of closed-loop scores, with the dissertation's controller and ours in bold."""
    keys, bold = frame[KEYS].to_dict("records"), (vars(names.AS_PUBLISHED), vars(names.OURS))
    strong = frozenset(row for row, its in enumerate(keys) if its in bold)
    frame = frame.assign(form=frame["form"].map(names.FORM_NAMES))
    headings, formats = ({name: both[place] for name, both in LOOP_COLUMNS.items()} for place in (0, 1))
    return Table(frame, formats, headings, strong)


def _data(results: ServoingResults) -> pd.DataFrame:
    """Sizes of the data set: columns `quantity`, `dissertation`, `here`."""
    dataset, person, geodesics = results.dataset, results.chosen["toucher"], results.chosen["geodesics"]
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
        ("pairs of successive actions, at five rates", str(PUBLISHED["pairs"]), str(results.pairs)),
        ("bins of samples for geodesics", printed, f"{bins} of {bin_size}"),
        ("training | validation | test, % of the samples", PUBLISHED["splits"], shares),
        ("… contacts", "not said", contacts_by_split),
    ]
    return pd.DataFrame(rows, columns=["quantity", "dissertation", "here"])


def _test_chains(results: ServoingResults) -> list[tuple[str, int, int]]:
    """Number of test chains and contacts of the forward and inverse models, by motion."""
    first, dataset = results.tested.rows[:, 0], results.dataset
    rows = []
    for name, number in MOTIONS.items():
        if number in dataset.motion:
            its = first[dataset.motion[first] == number]
            rows.append((name, len(its), len(np.unique(dataset.contact[its]))))
    return rows
