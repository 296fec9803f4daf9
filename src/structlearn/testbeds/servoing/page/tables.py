"""Tables of the servoing testbed: counts of data, and how the page shows the scores."""

import numpy as np
import pandas as pd

from structlearn.reporting.document import Table
from structlearn.tactile.touch_dataset import OTHER, ROTATION, SPLITS, TRANSLATION
from structlearn.testbeds.servoing.names import (
    COMPARISON_NAMES,
    FORM_NAMES,
    LATENT_NAMES,
    OURS,
    SKIN_NAMES,
    TEXT,
)
from structlearn.testbeds.servoing.page.findings import rate
from structlearn.testbeds.servoing.page.results import PUBLISHED, ServoingResults
from structlearn.testbeds.servoing.protocol.model_scores import skin_table
from structlearn.testbeds.servoing.protocol.servo_scores import ControllerScores
from structlearn.testbeds.servoing.protocol.servo_variants import Variant

MOTIONS = {"rotation": ROTATION, "translation": TRANSLATION, "any motion": OTHER}

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
"""Headings and formats of closed loops."""


def tables(results: ServoingResults) -> dict[str, Table]:
    """All tables by name."""
    models, skins = results.models, results.skin_tables
    loops = {SKIN_NAMES[name]: loop_table(one) for name, one in results.skins.items()}
    learned = skin_table(skins.latent, skins.directions)
    found = {
        "data": Table(data(results)),
        "test_chains": Table(test_chains(results)),
        "latent": _rounded(models.latent_table(), ".4f", LATENT_NAMES),
        "forward": _rounded(models.forward_table(), ".3f"),
        "directions": _rounded(models.direction_table(), ".3f", {"loss": "its loss"} | COMPARISON_NAMES),
        "other_skins": _rounded(learned.assign(skin=learned["skin"].map(SKIN_NAMES)), ".4f", LATENT_NAMES),
        "other_skin_loops": _loops(pd.concat(loops, names=["skin", None]).reset_index("skin")),
    }
    return found if results.trials is None else found | {"loops": _loops(loop_table(results.trials))}


def loop_table(trials: ControllerScores) -> pd.DataFrame:
    """A row for each controller, see `ControllerScores.table`; `low` to `high`: interval of its rate."""
    table = trials.table()
    found = [rate(trials, Variant(**keys)) for keys in table[list(vars(TEXT))].to_dict("records")]
    place = table.columns.get_loc("rate") + 1
    table.insert(place, "low", [one.low for one in found])
    table.insert(place + 1, "high", [one.high for one in found])
    return table


def _rounded(frame: pd.DataFrame, number_format: str, headings: dict[str, str] | None = None) -> Table:
    return Table(frame, dict.fromkeys(frame.select_dtypes("floating"), number_format), headings or {})


def _loops(frame: pd.DataFrame) -> Table:
    """Closed loops, with the dissertation's controller and ours in bold."""
    keys = frame[list(vars(TEXT))].to_dict("records")
    strong = frozenset(row for row, its in enumerate(keys) if its in (vars(TEXT), vars(OURS)))
    frame = frame.assign(form=frame["form"].map(FORM_NAMES))
    headings, formats = ({name: both[place] for name, both in LOOP_COLUMNS.items()} for place in (0, 1))
    return Table(frame, formats, headings, strong)


def data(results: ServoingResults) -> pd.DataFrame:
    """Counts of the data: columns `quantity`, `dissertation`, `here`."""
    dataset, person = results.dataset, results.chosen["toucher"]
    geodesics = results.chosen["geodesics"]
    trials = " | ".join(f"{person.areas} areas x {one}" for one in (person.rotations, person.translations))
    motions = [ROTATION, TRANSLATION]
    by_motion = [dataset.motion == motion for motion in motions]
    by_split = [dataset.split == split for split in SPLITS.values()]
    contacts = [
        " | ".join(str(len(np.unique(dataset.contact[part]))) for part in parts)
        for parts in (by_motion, by_split)
    ]
    bins, bin_size = len(dataset) // geodesics.bin_size, min(geodesics.bin_size, len(dataset))
    bins = bins if geodesics.bins is None else min(bins, geodesics.bins)
    of_text = PUBLISHED["bin_size"]
    rows = [
        ("demonstrations, rotation | translation", PUBLISHED["demonstrations"], trials),
        ("contacts, rotation | translation", PUBLISHED["contacts"], contacts[0]),
        (
            "samples, rotation | translation",
            "half and half",
            " | ".join(str(part.sum()) for part in by_motion),
        ),
        ("samples of touch", str(PUBLISHED["samples"]), str(len(dataset))),
        ("pairs of successive actions, at five rates", str(PUBLISHED["pairs"]), str(results.pairs)),
        (
            "bins of samples for geodesics",
            f"{PUBLISHED['samples'] // of_text} of {of_text}",
            f"{bins} of {bin_size}",
        ),
        (
            "training | validation | test, % of the samples",
            PUBLISHED["splits"],
            " | ".join(f"{100 * part.mean():.1f}" for part in by_split),
        ),
        ("… contacts", "not said", contacts[1]),
    ]
    return pd.DataFrame(rows, columns=["quantity", "dissertation", "here"])


def test_chains(results: ServoingResults) -> pd.DataFrame:
    """What forward and inverse models are tested on: `motion`, `contacts`, `chains`."""
    first, dataset = results.tested.rows[:, 0], results.dataset
    rows = []
    for name, number in MOTIONS.items():
        if number in dataset.motion:
            its = first[dataset.motion[first] == number]
            rows.append((name, len(np.unique(dataset.contact[its])), len(its)))
    return pd.DataFrame(rows, columns=["motion", "contacts", "chains"])
