"""Findings on tactile servoing for the page's sentences and claims.

Claims and sentences generalise over people. The study `servoing/people` repeats the whole branch for each
person with new demonstrations, sensor, models and trials, so people are independent samples; seeds of one
person's models are not. A person's row `servo_success_rate` is one sample of `people_servo_success_rate`,
whose n counts people. Rows on the person of this run exist for the study to gather; no verdict uses them.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dissertation.evidence.studies import OURS as STUDIED
from dissertation.evidence.studies import People, Study
from dissertation.servoing.names import (
    AS_PUBLISHED,
    DYNAMICS,
    OURS,
    SKIN_NAMES,
    STILL,
    STRUCTURE_NAMES,
    dynamics_name,
)
from dissertation.servoing.protocol.servo_scores import ControllerScores
from dissertation.servoing.protocol.servo_variants import (
    AS_DATA,
    ServoVariant,
    variants_of_other_skins,
)
from structlearn.core.metrics import matching
from structlearn.core.params import read_values
from structlearn.reporting.evidence import (
    UNKNOWN,
    Counts,
    Evidence,
    Found,
    clustered_share,
    difference,
    smallest,
)
from structlearn.reporting.findings import Findings
from structlearn.tactile.electrodes import SKINS, Skin, align_map
from structlearn.tactile.latent_parameters import FORWARD_OF, JACOBIAN, LOCALLY_LINEAR, NO_INVERSE, STRUCTURES
from structlearn.tactile.touch_dataset import SPLITS, TEST, TEST_STRIDE, Chains, TouchDataset, chains

PUBLISHED = read_values(Path(__file__).with_name("published.yaml"))  # numbers as the dissertation prints them

PEOPLE_STUDY = "servoing/people"  # the study behind the verdicts
TEST_CHAIN = 3  # prediction steps at which forward models are compared; they are trained on two (II.4.4)
SQUARE_MM = 1.5  # side of the squares of skin over which errors are averaged

AS_PUBLISHED_LL = replace(AS_PUBLISHED, inverse=LOCALLY_LINEAR)  # the dissertation did not run it on a robot

RATE, FORWARD = "servo_success_rate", "forward_nmse"
SPACE_KEYS = {True: "struct", False: "nostruct"}  # latent spaces with and without structure in finding names

HEADLINES_OF_ONE = {
    "reconstruction_nmse": ("test",),
    "mds_nmse": ("test",),
    FORWARD: ("chain3_struct",),
    "cosine_distance": ("nj", "nj_without_loss"),
    RATE: ("", "published", "nostruct", "sphere", "flat_pad"),
}
"""Headlines for comparing experiments when the study was not run with these parameters."""

PREDICTED = {
    f"chain{TEST_CHAIN}_{part}{SPACE_KEYS[space]}": (part.rstrip("_") or "nmse", space)
    for part, space in product(("", "plane_", "third_", "pressure_", "electrodes_"), STRUCTURES)
}
"""Forward NMSE of NL with NJ, by case: column of `ModelScores.forwards`, and whether with structure."""


@dataclass(frozen=True)
class ModelScores:
    """Tables of `tactile.latent_comparison.LatentComparison`, with arrays over the S seeds."""

    latent: pd.DataFrame
    forward: pd.DataFrame
    decoded: pd.DataFrame
    directions: pd.DataFrame
    curve: pd.DataFrame
    latent_map: pd.DataFrame

    @property
    def steps(self) -> list[int]:
        """Chain lengths on which forward models were tested."""
        return sorted(self.forward["steps"].unique().tolist())

    def latents(self, column: str, structure: bool = True, split: str = "test") -> np.ndarray:
        """One latent-space error (S,)."""
        rows = matching(self.latent, structure=structure, split=split)
        return rows.sort_values("seed")[column].to_numpy()

    def forwards(
        self,
        forward: str,
        trained_with: str,
        structure: bool = True,
        steps: int = TEST_CHAIN,
        column: str = "nmse",
    ) -> np.ndarray:
        """Forward NMSE (S,), or another column of `forward` or `decoded`."""
        table = self.forward if column in self.forward else self.decoded
        keys = {"forward": forward, "trained_with": trained_with, "structure": structure, "steps": steps}
        return matching(table, **keys).sort_values("seed")[column].to_numpy()

    def relative_forwards(
        self, forward: str, trained_with: str, structure: bool = True, steps: int = TEST_CHAIN
    ) -> np.ndarray:
        """Forward NMSE divided by that of the "nothing moves" baseline (S,)."""
        still = self.forwards(*STILL, structure, steps)
        return self.forwards(forward, trained_with, structure, steps) / still

    def cosines(
        self,
        inverse: str,
        with_loss: bool = True,
        structure: bool = True,
        comparison: str = "encoder",
        part: str | None = None,
    ) -> np.ndarray:
        """Cosine distance (S,) of an inverse model whose forward model was trained with or without its loss.

        Averaged over both parts of an action unless `part` is given; `comparison`: see `COMPARISON_NAMES`.
        """
        keys = {"inverse": inverse, "trained_with": inverse if with_loss else NO_INVERSE}
        keys |= {} if part is None else {"part": part}
        rows = matching(self.directions, structure=structure, comparison=comparison, **keys)
        return rows.groupby("seed")["distance"].mean().to_numpy()

    def training(self, quantity: str) -> pd.DataFrame:
        """Learning curve of a quantity, with structure: rows are training steps, columns seeds."""
        rows = self.curve[self.curve["structure"] & (self.curve["quantity"] == quantity)]
        return rows.pivot_table("value", "step", "seed")

    def steps_until(self, quantity: str, bound: float) -> int | None:
        """Training step from which a quantity stays below a bound in all seeds; None if it never does."""
        above = (self.training(quantity).max(axis=1) >= bound)[::-1].cummax()
        return None if above.iloc[0] else int(above.index[~above][-1])

    def halfway(self, quantity: str) -> float:
        """Mean over seeds of a quantity at half of the training steps, or the first point after."""
        means = self.training(quantity).mean(axis=1)
        return float(means[means.index >= 0.5 * means.index.max()].iloc[0])


@dataclass(frozen=True)
class ServoingResults:
    """Outputs of the testbed's stages."""

    dataset: TouchDataset
    truth: pd.DataFrame  # true contacts of the demonstrations
    models: ModelScores
    loops: Mapping[str, pd.DataFrame]  # tables of `protocol.servo_trials.compare_controllers`
    skin_tables: Mapping[str, pd.DataFrame]  # `latent`, `directions`, `trials` of other skins, by `skin`
    chosen: Mapping[str, Any]  # parameters, keyed as in `params.yaml`
    study: Study | None  # over people; None if it was not run

    @property
    def skin(self) -> Skin:
        """Skin of the demonstrations."""
        return SKINS[self.chosen["toucher"].skin]

    @cached_property
    def trials(self) -> ControllerScores:
        """Closed-loop trials with this skin."""
        return ControllerScores(self.loops["trials"])

    @cached_property
    def skins(self) -> dict[str, ControllerScores]:
        """Closed-loop trials with other skins, keyed by skin."""
        groups = self.skin_tables["trials"].groupby("skin", sort=False)
        return {str(name): ControllerScores(rows) for name, rows in groups}

    @property
    def people(self) -> People:
        """Findings of several people, each with their own sensor and models."""
        return People(self.study, STUDIED)

    def trials_per_person(self, skin: str = "") -> int:
        """Number of targets per controller over all models of one person, with this skin or another."""
        return self.chosen["other_skins" if skin else "train_latent"].seeds * self.chosen["servo"].trials

    @cached_property
    def pairs(self) -> int:
        """Number of pairs as the dissertation counts them, over all splits and strides."""
        return len(chains(self.dataset, 2))

    @cached_property
    def tested(self) -> Chains:
        """Test chains of the forward and inverse models."""
        return chains(self.dataset, self.chosen["train_latent"].longest_chain, (TEST_STRIDE,), TEST)

    @cached_property
    def places(self) -> np.ndarray:
        """Surface coordinates (N, 2) of the estimated contact points in mm: along and across the finger."""
        return 1e3 * np.stack(self.skin.coordinates(self.dataset.contact_point.astype(float)), axis=1)

    @cached_property
    def map_on_skin(self) -> np.ndarray:
        """Latent map (N, 2) in mm, aligned with the surface coordinates."""
        unit_mm = 1e3 * self.chosen["train_latent"].map_unit_m
        flat = unit_mm * self.models.latent_map[["x", "y"]].to_numpy(float)
        return align_map(flat, self.places)(flat)

    @cached_property
    def contact_errors(self) -> pd.DataFrame:
        """Errors of the estimated contact points of pressed samples.

        Columns: `error_mm`, Euclidean distance; `along_mm` and `across_mm`, differences in surface
        coordinates; `true_along_mm` and `true_across_mm`, the true contact.
        """
        dataset, truth = self.dataset, self.truth
        numbers = {name: number for number, name in enumerate(truth["trial"].unique())}
        rate_hz = float(dataset.rate_hz)
        samples = np.rint(truth["time_s"].to_numpy() * rate_hz).astype(int)
        true = truth.set_index([truth["trial"].map(numbers), samples])[["x_m", "y_m", "z_m"]]
        kept = np.flatnonzero(dataset.pressed)
        its = [dataset.trial[kept], np.rint(dataset.time[kept] * rate_hz).astype(int)]
        points = true.loc[pd.MultiIndex.from_arrays(its)].to_numpy(float)
        found = dataset.contact_point[kept].astype(float)
        estimated, real = (1e3 * np.stack(self.skin.coordinates(one)) for one in (found, points))
        along, across = estimated - real
        error_mm = 1e3 * np.linalg.norm(found - points, axis=1)
        columns = {"error_mm": error_mm, "along_mm": along, "across_mm": across}
        return pd.DataFrame(columns | {"true_along_mm": real[0], "true_across_mm": real[1]})


def contact_bias(errors: pd.DataFrame) -> pd.DataFrame:
    """Mean of `contact_errors` over squares of skin, by true contact.

    Columns: `square_along_mm`, `square_across_mm`, the square's centre; means of `along_mm`, `across_mm`,
    `error_mm`; `samples`; `squared_mm2`, the contribution of the square's bias to the sum of squared errors.
    """
    squares = [
        (SQUARE_MM * (np.floor(errors[f"true_{name}_mm"] / SQUARE_MM) + 0.5)).rename(f"square_{name}_mm")
        for name in ("along", "across")
    ]
    groups = errors[["along_mm", "across_mm", "error_mm"]].groupby(squares)
    means = groups.mean().assign(samples=groups.size())
    squared = means["samples"] * (means["along_mm"] ** 2 + means["across_mm"] ** 2)
    return means.assign(squared_mm2=squared).reset_index()


def findings(results: ServoingResults) -> Findings:
    """All findings of the page; findings over people are "not tested" if the study was not run."""
    find = Findings(f"models of person {results.chosen['toucher'].seed}")
    _of_person(find, results)
    if not results.people.count:
        find.mark(HEADLINES_OF_ONE)
    over_people(find.among("people", PEOPLE_STUDY), results)
    return find


def over_people(find: Findings, results: ServoingResults) -> None:
    """Add the findings that claims and sentences rest on."""
    _prediction(find, results.people)
    _closed_loop(find, results)


def rate(trials: ControllerScores, variant: ServoVariant) -> Evidence:
    """Success rate of a controller over one person's trials, with an interval clustered by model."""
    counts = trials.counts(variant)
    found = clustered_share(counts["success"].to_numpy(), counts["trials"].to_numpy())
    return replace(found, people=None)  # clusters are trained models, not people


def rate_case(variant: ServoVariant, skin: str = "") -> str:
    """Name of a controller's case, e.g. `ll_nostruct_published`; values that `OURS` has are left out."""
    return key(
        skin,
        "" if variant.inverse == JACOBIAN else variant.inverse.lower(),
        "" if variant.structure else SPACE_KEYS[False],
        "" if variant.with_loss else "without_loss",
        "as_data" if variant.change == AS_DATA else "",
        "published" if variant.form == AS_PUBLISHED.form else "",
    )


def forward_case(
    forward: str, trained_with: str, structure: bool, steps: int = TEST_CHAIN, column: str = ""
) -> str:
    """Name of a forward-NMSE case, e.g. `chain3_pressure_nl_nj_struct`."""
    loss = "" if trained_with == NO_INVERSE else trained_with.lower()
    return key(f"chain{steps}", column, forward.lower(), loss, SPACE_KEYS[structure])


def key(*words: str) -> str:
    """Join the non-empty words of a finding's name or case by underscores."""
    return "_".join(filter(None, words))


def rated() -> list[ServoVariant]:
    """Controllers whose success rate is a finding."""
    cases = product((AS_PUBLISHED.form, OURS.form), FORWARD_OF, STRUCTURES, (True, False))
    every = [ServoVariant(*case) for case in cases]
    return every + [replace(form, change=AS_DATA) for form in (AS_PUBLISHED, OURS)]


def _of_person(find: Findings, results: ServoingResults) -> None:
    """Add means over models on test contacts, with structure unless stated otherwise.

    `forward_nmse_chain3_struct` is of NL with NJ. Cosine distances are of actions for the latent state that
    followed (`*_predicted`: for the predicted one), with the forward model trained with each inverse.
    """
    models, loops = results.models, results.trials
    ours = loops.rate(OURS)
    find.exact("samples", len(results.dataset))
    find.exact("pairs", results.pairs)
    find.exact("contact_point_error_mm", results.contact_errors["error_mm"].median())
    find.exact("pressure_nmse_test", models.latents("pressure").mean())
    for name in ("trials", "reach_s", "path_ratio"):
        find.exact(f"servo_{name}", ours[name])
    for name, column in (("reconstruction_nmse", "reconstruction"), ("mds_nmse", "distances")):
        find.mean(name, {split: models.latents(column, split=split) for split in SPLITS})
    errors = {
        case: models.forwards("NL", "NJ", space, column=column) for case, (column, space) in PREDICTED.items()
    }
    for kind, space in product(DYNAMICS, STRUCTURES):
        for steps in range(1, TEST_CHAIN + 1):
            errors[forward_case(*kind, space, steps)] = models.forwards(*kind, space, steps)
        pressure = models.forwards(*kind, space, column="pressure")
        errors[forward_case(*kind, space, column="pressure")] = pressure
    find.mean(FORWARD, errors)
    cosines = {name.lower(): models.cosines(name) for name in FORWARD_OF}
    predicted = {name: models.cosines(name, comparison="forward") for name in FORWARD_OF}
    cosines |= {f"{name.lower()}_predicted": its for name, its in predicted.items()}
    find.mean("cosine_distance", cosines | {"nj_without_loss": models.cosines("NJ", with_loss=False)})
    rates = {rate_case(one): rate(loops, one) for one in rated()}
    for skin, its in results.skins.items():
        rates |= {rate_case(one, skin): rate(its, one) for one in variants_of_other_skins()}
    find.add(RATE, rates)
    counts = {"": loops.counts(OURS).sum(), "published": loops.counts(AS_PUBLISHED).sum()}
    lost = {case: (its["lost"], its["trials"]) for case, its in counts.items()}
    find.exact_count("servo_contacts_lost", lost)


def _prediction(find: Findings, people: People) -> None:
    """Add means of latent spaces, forward and inverse models, and differences paired by person."""
    numbers = people.numbers

    def cosines(name: str, ending: str = "") -> np.ndarray | None:
        return numbers(f"cosine_distance_{name.lower()}{ending}")

    def forward(kind: tuple[str, str], structure: bool, steps: int = TEST_CHAIN, column: str = "") -> Any:
        return numbers(f"{FORWARD}_{forward_case(*kind, structure, steps, column)}")

    for name in ("reconstruction_nmse", "mds_nmse"):
        splits = {split: numbers(f"{name}_{split}") for split in SPLITS}
        find.mean(f"people_{name}", splits, headline=("test",))
    grows = {name: _smallest_rise(forward, structure) for structure, name in STRUCTURE_NAMES.items()}
    find.add("grows", grows)
    for name, column in (("structure_predicts", ""), ("structure_predicts_pressure", "pressure")):
        pairs = {
            dynamics_name(*kind): (forward(kind, False, column=column), forward(kind, True, column=column))
            for kind in DYNAMICS
        }
        find.difference(name, pairs)
    with_loss = {
        dynamics_name(model, loss): (forward((model, loss), True), forward((model, NO_INVERSE), True))
        for model, loss in DYNAMICS
        if loss != NO_INVERSE
    }
    find.difference("loss_predicts", with_loss)
    others = {f"{name} minus NJ": (cosines(name), cosines("NJ")) for name in FORWARD_OF if name != "NJ"}
    find.difference("nj_predicts", others)
    find.difference("loss_directs", cosines("NJ", "_without_loss"), cosines("NJ"))
    find.difference("easier", {name: (cosines(name), cosines(name, "_predicted")) for name in FORWARD_OF})
    for case in PREDICTED:
        headline = case in HEADLINES_OF_ONE[FORWARD]
        find.mean(f"people_{FORWARD}_{case}", numbers(f"{FORWARD}_{case}"), headline=headline)
    for name in ("ll", "ng", "nj", "nj_without_loss"):
        find.mean(f"people_cosine_distance_{name}", numbers(f"cosine_distance_{name}"), headline="nj" in name)


def _closed_loop(find: Findings, results: ServoingResults) -> None:
    """Add success rates, and differences in percentage points paired by person."""
    find.exact("people", results.people.count or float("nan"), headline=True)

    def rates(variant: ServoVariant, skin: str = "") -> np.ndarray | None:
        return results.people.numbers(key(RATE, rate_case(variant, skin)))

    def share(name: str, *given: object, skin: str = "", headline: bool = False) -> Found:
        return find.by(partial(_clustered, results.trials_per_person(skin)), name, *given, headline=headline)

    def counts(variant: ServoVariant) -> Counts | None:
        its = rates(variant)
        return None if its is None else _counts(results.trials_per_person(), its)

    def gain(name: str, form: ServoVariant, **without: Any) -> None:
        models = {inverse: replace(form, inverse=inverse) for inverse in FORWARD_OF}
        pairs = {inverse: (counts(one), counts(replace(one, **without))) for inverse, one in models.items()}
        find.rate_difference(name, pairs)

    shown = [(AS_PUBLISHED, ""), (AS_PUBLISHED_LL, ""), (OURS, ""), (replace(OURS, structure=False), "")]
    shown += [(variant, skin) for skin in results.skins for variant in (AS_PUBLISHED, OURS)]
    for variant, skin in shown:
        name, headline = key("people", RATE, rate_case(variant, skin)), not skin or variant == OURS
        share(name, rates(variant, skin), skin=skin, headline=headline)
    trials = results.trials_per_person()
    for ending in ("", "_published"):
        lost = results.people.numbers(f"servo_contacts_lost{ending}")
        share(f"people_servo_contacts_lost{ending}", None if lost is None else lost / trials)
    for ending, variant in (("", AS_PUBLISHED), ("_ll", AS_PUBLISHED_LL), ("_aimed", OURS)):
        with_skins = {SKIN_NAMES[skin]: rates(variant, skin) for skin in results.skins}
        its = rates(variant)
        serves = variant == OURS or (its is not None and _clustered(trials, its).low > 0.5)
        # if a controller fails anyway, its failures with other skins or without the loss show nothing
        if variant != OURS:
            share(f"loss_needed{ending}", rates(replace(variant, with_loss=False)) if serves else None)
        if serves:
            share(f"geometry{ending}", with_skins, skin="other")
        else:
            find.unknown(f"geometry{ending}")
    gain("structure_serves", AS_PUBLISHED, structure=False)
    gain("structure_serves_resting", OURS, structure=False)
    gain("loss_serves", OURS, with_loss=False)


def _clustered(trials: int, rates: np.ndarray, comparisons: int = 1) -> Evidence:
    """Success rate over people with `trials` trials each, from their rates (P,)."""
    return clustered_share(*_counts(trials, rates), comparisons)


def _counts(trials: int, rates: np.ndarray) -> Counts:
    """Hits (P,) in `trials` trials each (P,), from the rates (P,)."""
    return np.rint(trials * rates), np.full(len(rates), trials)


def _smallest_rise(forward: Callable[..., Any], structure: bool) -> Evidence:
    """Smallest rise of forward NMSE from one prediction step to the next, over all models."""
    cases = [(kind, steps) for kind in DYNAMICS for steps in range(1, TEST_CHAIN)]
    pairs = [(forward(kind, structure, n + 1), forward(kind, structure, n)) for kind, n in cases]
    if any(one is None for pair in pairs for one in pair):
        return UNKNOWN
    return smallest(difference(*pair, comparisons=len(cases)) for pair in pairs)
