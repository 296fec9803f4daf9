"""Tables of the servoing testbed: counts, latent spaces, forward and inverse models over seeds."""

import numpy as np
import pandas as pd

from structlearn.tactile.latent_comparison import SPLITS
from structlearn.tactile.latent_evaluation import UNCHANGED
from structlearn.tactile.latent_models import FORWARD_OF, NO_INVERSE, STRUCTURES
from structlearn.tactile.touch_dataset import OTHER, ROTATION, TRANSLATION
from structlearn.testbeds.servoing.page.servoing_other_skins import OtherSkins
from structlearn.testbeds.servoing.page.servoing_published import (
    DISTANCES_NMSE,
    PAIRS,
    RECONSTRUCTION_NMSE,
    SAMPLES,
    TEST_CHAIN,
)
from structlearn.testbeds.servoing.page.servoing_results import (
    ASKED,
    TRAINED_DYNAMICS,
    ServoingResults,
    seed_interval,
)

LATENT_COLUMNS = {
    "reconstruction": "reconstruction",
    "worst_electrode": "worst electrode",
    "distances": "map distances",
    "pressure": "pressure",
}
"""Errors of latent spaces and their names."""

MOTION_NAMES = {"rotation": ROTATION, "translation": TRANSLATION, "any motion": OTHER}

BOUNDS = {"reconstruction": RECONSTRUCTION_NMSE, "distances": DISTANCES_NMSE}

COMPARISONS = {
    "forward": "to what is predicted",
    "encoder": "to what followed",
    "agreement": "one against the other",
}
"""Comparisons of directions, in the order of figure II.5."""

PARTS = {"translation": "linear", "rotation": "angular"}
"""Parts of an action by their names in tables of the stages."""


def tables(results: ServoingResults) -> dict[str, pd.DataFrame]:
    """Tables of the page by name."""
    found = {
        "data": data(results),
        "test_chains": test_chains(results),
        "latent": latent(results),
        "forward": forward(results),
        "directions": directions(results),
        "other_skins": other_skins(results.other_skins),
        "other_skin_loops": results.other_skins.table(),
    }
    return found if results.loop is None else found | {"loops": results.loop.table()}


def structure_name(structure: bool) -> str:
    """How a latent space is called."""
    return "structure" if structure else "no structure"


def dynamics_name(forward: str, trained_with: str) -> str:
    """`NL with NJ's loss` or `NL`."""
    if forward == UNCHANGED:
        return "nothing moves"
    return forward if trained_with == NO_INVERSE else f"{forward} with {trained_with}'s loss"


def data(results: ServoingResults) -> pd.DataFrame:
    """Counts of the data: columns `quantity`, `dissertation`, `here`; who recorded says no motions."""
    dataset, person = results.dataset, results.person
    trials, contacts, samples = [f"{len(np.unique(dataset.trial))}"], [], []
    if results.simulated:
        trials = [f"{person.areas} areas x {count}" for count in (person.rotations, person.translations)]
    for number in (ROTATION, TRANSLATION) if results.simulated else np.unique(dataset.motion):
        rows = dataset.motion == number
        contacts.append(f"{len(np.unique(dataset.contact[rows]))}")
        samples.append(f"{rows.sum()}")
    parts = [dataset.split == number for number in SPLITS.values()]
    shares = [f"{100 * part.mean():.1f}" for part in parts]
    split_contacts = [len(np.unique(dataset.contact[part])) for part in parts]
    bins = len(dataset) // results.geodesics.bin_size
    rows = [
        (
            "demonstrations, rotation | translation",
            "7 areas x 3 | 7 areas x 4",
            " | ".join(trials),
        ),
        ("contacts, rotation | translation", "42 | 112", " | ".join(contacts)),
        ("samples, rotation | translation", "half and half", " | ".join(samples)),
        ("samples of touch", f"{SAMPLES}", f"{len(dataset)}"),
        ("pairs of successive actions, at five rates", f"{PAIRS}", f"{results.pairs}"),
        (
            "bins of samples for geodesics",
            f"{SAMPLES // 2310} of 2310",
            f"{bins if results.geodesics.bins is None else min(bins, results.geodesics.bins)} of "
            f"{min(results.geodesics.bin_size, len(dataset))}",
        ),
        ("training | validation | test, % of the samples", "85 | 7.5 | 7.5", " | ".join(shares)),
        ("… contacts", "not said", " | ".join(map(str, split_contacts))),
    ]
    return pd.DataFrame(rows, columns=["quantity", "dissertation", "here"])


def test_chains(results: ServoingResults) -> pd.DataFrame:
    """What forward and inverse models are tested on: `motion`, `contacts`, `chains`."""
    first = results.tested.rows[:, 0]
    rows = []
    for name, number in MOTION_NAMES.items():
        if number not in results.dataset.motion:
            continue
        its = first[results.dataset.motion[first] == number]
        rows.append((name, len(np.unique(results.dataset.contact[its])), len(its)))
    return pd.DataFrame(rows, columns=["motion", "contacts", "chains"])


def latent(results: ServoingResults) -> pd.DataFrame:
    """Errors of latent spaces: `space`, `split`, and mean, half interval and worst seed of each column."""
    rows = []
    for structure in STRUCTURES:
        for split in SPLITS:
            row: dict[str, object] = {"space": structure_name(structure), "split": split}
            for column in LATENT_COLUMNS:
                values = results.latents(column, structure, split)
                mean, half = seed_interval(values)
                row |= {column: mean, f"{column}_half": half, f"{column}_worst": values.max()}
            rows.append(row)
    return pd.DataFrame(rows)


def forward(results: ServoingResults) -> pd.DataFrame:
    """Forward NMSE per length of the chain (figure II.4).

    Returns:
        `model`, `space`, `steps`, `nmse` (mean over seeds), `half` (of its 95 % interval), `relative` and
        `relative_half`: over the error of the prediction that nothing moves.
    """
    rows = []
    for kind, way in dynamics_kinds():
        for structure in STRUCTURES:
            for steps in results.steps:
                mean, half = seed_interval(results.forwards(kind, way, structure, steps))
                relative, relative_half = seed_interval(
                    results.relative_forwards(kind, way, structure, steps)
                )
                rows.append(
                    {
                        "model": dynamics_name(kind, way),
                        "space": structure_name(structure),
                        "steps": steps,
                        "nmse": mean,
                        "half": half,
                        "relative": relative,
                        "relative_half": relative_half,
                    }
                )
    return pd.DataFrame(rows)


def forward_at_test(results: ServoingResults) -> pd.DataFrame:
    """Rows of `forward` at the length of the dissertation's test, structure beside none.

    Returns:
        `model`; `structure`, `none` (NMSE), `structure_relative`, `none_relative`.
    """
    rows = []
    for kind, way in dynamics_kinds():
        row: dict[str, object] = {"model": dynamics_name(kind, way)}
        for name, values in (("", results.forwards), ("_relative", results.relative_forwards)):
            for structure in STRUCTURES:
                label = f"{'structure' if structure else 'none'}{name}"
                row[label] = values(kind, way, structure, TEST_CHAIN).mean()
        rows.append(row)
    return pd.DataFrame(rows)


def directions(results: ServoingResults) -> pd.DataFrame:
    """Cosine distances (figure II.5).

    Returns:
        `inverse`, `loss` (whether trained with it), `space`, and per comparison the mean over seeds of both
        parts, `<comparison>`, half its interval, `<comparison>_half`, and of each part alone,
        `<comparison>_linear`, `<comparison>_angular`.
    """
    rows = []
    for inverse in FORWARD_OF:
        for with_loss in (True, False):
            for structure in STRUCTURES:
                row: dict[str, object] = {
                    "inverse": inverse,
                    "loss": with_loss,
                    "space": structure_name(structure),
                }
                for comparison in COMPARISONS:
                    found = {
                        part: results.cosines(inverse, with_loss, structure, comparison, part)
                        for part in (None, *PARTS)
                    }
                    mean, half = seed_interval(found[None])
                    row |= {comparison: mean, f"{comparison}_half": half}
                    row |= {f"{comparison}_{name}": found[part].mean() for part, name in PARTS.items()}
                rows.append(row)
    return pd.DataFrame(rows)


def other_skins(skins: OtherSkins) -> pd.DataFrame:
    """What was learned of other skins, with structure, on test contacts; means over seeds.

    Returns:
        `skin`; the errors of `LATENT_COLUMNS`; cosine distances of actions to reach what followed, by inverse
        models that were trained with their loss: `<inverse>_linear`, `<inverse>_angular`.
    """
    spaces, table = skins.latent, skins.directions
    spaces = spaces[spaces["structure"] & (spaces["split"] == "test")]
    table = table[table["structure"] & (table["inverse"] == table["trained_with"])]
    asked = table[table["comparison"] == ASKED]
    asked = asked.assign(key=asked["inverse"] + "_" + asked["part"].map(PARTS))
    distances = asked.pivot_table("distance", "skin", "key")
    columns = [f"{inverse}_{part}" for inverse in FORWARD_OF for part in PARTS.values()]
    errors = spaces.groupby("skin", sort=False)[list(LATENT_COLUMNS)].mean()
    return errors.join(distances[columns]).reset_index()


def dynamics_kinds() -> list[tuple[str, str]]:
    """Forward models and ways to train them, those without an inverse model's loss first per model."""
    kinds = list(dict.fromkeys(forward for forward, _ in TRAINED_DYNAMICS))
    found = [(UNCHANGED, NO_INVERSE)]
    for kind in kinds:
        found += [(kind, NO_INVERSE), *(pair for pair in TRAINED_DYNAMICS if pair[0] == kind)]
    return found
