"""Evidence for the claims of the pages on segmentation and feedback: in the sweep, and over people.

One number per person: of each, the whole branch was run anew, demonstrations, sensor, corrections, models and
executions. So people are independent, which folds and executions of one person are not. The numbers are
those of `details.json` and `metrics.json` by the same keys, of the study `scraping/people`; what the person
of this run shows is put beside them and decides nothing.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from structlearn.core.artefacts import Metrics
from structlearn.reporting.claims import (
    UNKNOWN,
    Claim,
    Evidence,
    Found,
    by_case,
    difference,
    geometric_mean,
    mean,
)
from structlearn.reporting.prose import level_name, rounded
from structlearn.reporting.studies import Study
from structlearn.segmentation.alignment import METHODS, RESULT
from structlearn.segmentation.cut_errors import errors_by_seed
from structlearn.testbeds.scraping.names import CUT_METHODS
from structlearn.testbeds.scraping.page.feedback_results import MODEL_KEYS, REPRESENTATION_KEYS, STEP_KEYS
from structlearn.testbeds.scraping.page.segmentation_results import SegmentationResults


def weakest(found: Iterable[Evidence]) -> Evidence:
    """Of several numbers that all should be above zero the one that decides.

    That is one that is not known; else the clearest of those that are below zero; else that whose interval
    reaches lowest.
    """
    found = list(found)
    unknown = [one for one in found if not np.isfinite([one.value, one.low, one.high]).all()]
    refuted = [one for one in found if one.high <= 0.0]
    if not found or unknown:
        return unknown[0] if unknown else UNKNOWN
    return min(refuted, key=lambda one: one.high) if refuted else min(found, key=lambda one: one.low)


def sweep_evidence(results: SegmentationResults) -> dict[str, Found]:
    """Of the sweep's people.

    How much better the result's cut points are than each other method's, at the least clear level; and what
    is least true of down-sampling.
    """
    wide = errors_by_seed(results.noise).pivot_table(
        index=["noise_mm", "seed"], columns="method", values="error_ms"
    )
    wide = wide[wide.index.get_level_values("noise_mm") > 0]
    levels = wide.index.unique("noise_mm")
    others = [method for method in METHODS if method in wide and method != RESULT]
    found = {
        CUT_METHODS[other].name: weakest(
            difference(rows[other], rows[RESULT], comparisons=len(others) * len(levels))
            for _, rows in wide[[other, RESULT]].dropna().groupby(level="noise_mm")
        )
        for other in others
    }
    evidence: dict[str, Found] = {"least_cut_error": found} if len(wide) else {}
    worst = results.downsampling_worst
    named = {"work": "work", "shift": "shift_samples_text", "shift_ours": "shift_samples"}
    found = {f"downsampled_{name}": mean(worst[column]) for name, column in named.items() if len(worst)}
    return evidence | found


STUDY, VARIANT = "scraping/people", "ours"
"""The study whose numbers these are, and its variant with the parameters as they are."""

MODEL_PAIRS = {
    "order_of_structures": (("pmnn_100", "pmnn_0"), ("pmnn_0", "ffnn_phase"), ("ffnn_phase", "ffnn")),
    "phase_helps": (("ffnn_phase", "ffnn"),),
    "features_inside": (
        *(("pmnn_100", other) for other in ("pca", "autoencoder")),
        *(("pmnn_6", other) for other in ("pca", "autoencoder")),
    ),
    "more_nodes": (("pmnn_100", "pmnn_6"),),
}
"""Pairs (better, worse) of representations that a claim is made of."""

VALIDATED = "_validated"
"""Ends the names of evidence at the step that validation chose; else it is at the dissertation's."""

SUMMARISED = {
    mean: tuple(
        f"pmnn_prim{number}_generalization_nmse{suffix}" for number in (2, 3) for suffix in STEP_KEYS.values()
    ),
    geometric_mean: tuple(
        f"cost_ratio_{model}_over_nominal_{tilt}" for model in ("feedback", "level") for tilt in (0, 10)
    ),
}
"""Keys of `summary` by the mean that is taken of them."""


@dataclass(frozen=True)
class People:
    """One number per person, by key."""

    numbers: Callable[[str], np.ndarray]  # (P,) by key; raises KeyError where there is none of this key
    primitives: Sequence[str]  # names of all primitives in order of time

    @classmethod
    def of_study(cls, study: Study, primitives: Sequence[str]) -> "People":
        """All people of a study."""
        return cls(lambda key: study.values(VARIANT, key), primitives)

    @classmethod
    def of_one(cls, metrics: Metrics, primitives: Sequence[str]) -> "People":
        """The person of a report."""
        return cls(lambda key: np.array([metrics[key]], float), primitives)

    def nmse(self, representation: str, primitive: str, stopping: str = "generalization") -> np.ndarray:
        """(P,) generalisation NMSE, mean over folds; `stopping` is of `representation_orderings.STOPPINGS`.

        The default is the dissertation's: the step at which this very error is lowest (IV.9.3).
        """
        key = f"{REPRESENTATION_KEYS[representation]}_{self.number(primitive)}"
        return self.numbers(f"{key}_generalization_nmse{STEP_KEYS[stopping]}")

    def cost(self, model: str, primitive: str, setting_deg: float) -> np.ndarray:
        """(P,) accumulated cost in rad, mean over executions."""
        key = f"cost_{MODEL_KEYS[model]}_{self.number(primitive)}_{level_name(setting_deg)}"
        return self.numbers(key)

    def ratio(self, model: str, setting_deg: float, baseline: str = "nominal") -> np.ndarray:
        """(P,) accumulated cost of all primitives relative to that of another model, or of none."""
        over = self._over_nominal(model, setting_deg)
        return over if baseline == "nominal" else over / self._over_nominal(baseline, setting_deg)

    def _over_nominal(self, model: str, setting_deg: float) -> np.ndarray:
        return self.numbers(f"cost_ratio_{MODEL_KEYS[model]}_over_nominal_{level_name(setting_deg)}")

    def number(self, primitive: str) -> str:
        """`prim2`, counted as in the dissertation."""
        return f"prim{list(self.primitives).index(primitive) + 1}"


def least_clear(found: Iterable[Evidence]) -> Evidence:
    """`weakest`; of numbers without interval, as of one person, the smallest."""
    found = list(found)
    bounds = np.array([(one.value, one.low, one.high) for one in found]).reshape(-1, 3)
    if np.isfinite(bounds[:, 0]).all() and not np.isfinite(bounds).all():
        return min(found, key=lambda one: one.value)
    return weakest(found)


def share_left(ratios: Sequence[np.ndarray], comparisons: int = 1) -> Evidence:
    """Geometric mean over people of the ratio of costs, of several the one that is least clearly below 1.

    `ratios`: (P,) each. `comparisons`: of the claim, `claims.confidence`.
    """
    saved = least_clear(mean(-np.log(one), comparisons) for one in ratios)
    value, low, high = (float(np.exp(-one)) for one in (saved.value, saved.high, saved.low))
    return Evidence(value, low, high, saved.n)


def segmentation_evidence(people: People, aligned: Sequence[str]) -> dict[str, Found]:
    """Of the page on segmentation and primitives; `aligned` are the primitives that have an axis."""
    numbers = people.numbers
    return {
        "aligned_as_printed": by_case(
            mean, {name: (numbers(f"alignment_gain_mm_wls_text_{name}"),) for name in aligned}
        ),
        "aligned_with_crossings": by_case(
            mean, {name: (numbers(f"alignment_gain_mm_{RESULT}_{name}"),) for name in aligned}
        ),
        "smooth": by_case(
            mean,
            {
                "as demonstrated": (100.0 * numbers("acceleration_jump_nominal"),),
                "new situation": (100.0 * numbers("acceleration_jump_generalised"),),
            },
        ),
    }


def feedback_evidence(
    people: People, adapted: Sequence[str], settings_deg: Sequence[float]
) -> dict[str, Found]:
    """Of the page on feedback models.

    `settings_deg`: rolls of the board on which models were executed; none where nothing was.
    """
    found = _models(people, adapted)
    return found | _executions(people, adapted, settings_deg) if settings_deg else found


def _models(people: People, adapted: Sequence[str]) -> dict[str, Found]:
    found: dict[str, Found] = {}
    for stopping, ending in (("generalization", ""), ("validation", VALIDATED)):
        for name, pairs in MODEL_PAIRS.items():
            found[name + ending] = {
                primitive: least_clear(
                    difference(
                        people.nmse(worse, primitive, stopping),
                        people.nmse(better, primitive, stopping),
                        comparisons=len(pairs) * len(adapted),
                    )
                    for better, worse in pairs
                )
                for primitive in adapted
            }
        errors = {one: (people.nmse("pmnn_100", one, stopping),) for one in adapted}
        found[f"level_of_error{ending}"] = by_case(mean, errors)
    return found | known(_phase_dependent, people, adapted)


def _phase_dependent(people: People, adapted: Sequence[str]) -> dict[str, Found]:
    return {"phase_dependent": _by_primitive(people, "shared_nodes_over_phase", adapted)}


def _executions(people: People, adapted: Sequence[str], settings_deg: Sequence[float]) -> dict[str, Found]:
    tilted = [setting for setting in settings_deg if setting != 0.0]
    found: dict[str, Found] = {
        "tells_tilts_apart": _by_primitive(people, "coupling_smallest_step", adapted),
        "torque_monotone": _by_primitive(people, "roll_torque_smallest_step", adapted),
        "force_held": mean(people.numbers("force_largest_error_percent")),
    }
    found["lower_cost"] = {
        one: share_left(
            [people.cost("pointwise", one, tilt) / people.cost("nominal", one, tilt) for tilt in tilted],
            len(tilted) * len(adapted),
        )
        for one in adapted
    }
    for name, model in (("kept_at_tilts", "level"), ("in_the_unroll", "unrolled")):
        ratios = [people.ratio(model, tilt, "pointwise") for tilt in tilted]
        found[name] = share_left(ratios, len(tilted))
    if 0.0 in settings_deg:
        found["level_board"] = share_left([people.ratio("pointwise", 0.0)])
        found["level_board_ours"] = share_left([people.ratio("level", 0.0)])
    return found


def _by_primitive(people: People, key: str, adapted: Sequence[str]) -> Found:
    return by_case(mean, {one: (people.numbers(f"{key}_{people.number(one)}"),) for one in adapted})


def summary(people: People) -> Metrics:
    """Key figures over people, with the ends of their 95 % intervals; ratios by their geometric mean."""
    values: Metrics = {}
    for make, keys in SUMMARISED.items():
        for key in keys:
            numbers = people.numbers(key)
            found = make(numbers)
            values |= {f"people_{key}": found.value, "people": len(numbers)}
            values |= {f"people_{key}_low": found.low, f"people_{key}_high": found.high}
    return values


def known(make: Callable[..., dict], people: People | None, *arguments: object) -> dict:
    """What `make` finds; nothing where no people were studied, or a number is missing."""
    try:
        return make(people, *arguments) if people is not None else {}
    except KeyError:
        return {}


def beside(claims: Sequence[Claim], shown: Mapping[str, Found], seed: int) -> list[Claim]:
    """The claims, with what the person of the report shows in their notes.

    `claims`: of `read_claims`. `shown`: numbers of that person, by evidence. `seed`: the person's.
    """
    return [
        claim.model_copy(update={"note": f"{claim.note} Person {seed}: {_of_one(claim, shown)}.".strip()})
        if shown.get(claim.evidence)
        else claim
        for claim in claims
    ]


def _of_one(claim: Claim, shown: Mapping[str, Found]) -> str:
    found = shown[claim.evidence]
    cases = {"": found} if isinstance(found, Evidence) else found
    return ", ".join(f"{case} {rounded(one.value, claim.format)}".strip() for case, one in cases.items())
