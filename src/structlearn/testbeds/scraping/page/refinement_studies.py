"""What studies found of the refinement: over people, for the claims, and of its parameters, for two tables.

Of each person of the study `scraping/people` the whole branch was run anew, demonstrations, sensor, models
and refinement, once with the parameters as they are (`ours`) and once as in the text (`text`). The numbers
are those of `details.json` by the same keys. So a refinement is one number, judged over people.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from structlearn.ground.artefacts import Metrics
from structlearn.reporting.claims import Found, by_case, geometric_mean, mean
from structlearn.reporting.document import Table
from structlearn.reporting.prose import level_name
from structlearn.reporting.studies import Study
from structlearn.testbeds.scraping.page.refinement_results import RefinementResults
from structlearn.testbeds.scraping.protocol.executed_sets import AFTER, BEFORE

PEOPLE, ADDED, EXPLORATION = "scraping/people", "scraping/added_executions", "scraping/exploration"
STUDIES = (PEOPLE, ADDED, EXPLORATION)
"""That the page rests on."""

FORMS = ("text", "ours")
"""Variants of the study over people."""

Studies = Mapping[str, Study | None]


def refinement_evidence(
    results: RefinementResults, studies: Studies, number: Callable[[str], int]
) -> dict[str, Found]:
    """Of the page on refinement by trial; nothing where no people were studied.

    `results`: of the person shown, which say what was executed; their numbers decide nothing. `studies`: by
    name.
    """
    found: dict[str, Found] = {}
    for form, people in _by_form(studies, number(results.refined[0])).items():
        found |= _of_form(form, people, results, number)
    return found


def _by_form(studies: Studies, number: int) -> dict[str, Study]:
    """The study over people, once per form of which it says what became of a primitive."""
    people = studies.get(PEOPLE)
    if people is None or f"rl_cost_ratio_prim{number}" not in people.table:
        return {}
    return {form: people for form in FORMS if (people.table["variant"] == form).any()}


def _of_form(
    form: str, people: Study, results: RefinementResults, number: Callable[[str], int]
) -> dict[str, Found]:
    def of(key: str, name: str = "") -> np.ndarray:
        key = f"{key}_prim{number(name)}" if name else key
        return people.values(form, key) if key in people.table else np.array([np.nan])

    refined, executed = results.refined, results.primitives
    found: dict[str, Found] = {
        "lower": by_case(geometric_mean, {name: (of("rl_cost_ratio", name),) for name in refined}),
        "converged": by_case(mean, {name: (of("rl_later_gain", name),) for name in refined}),
        "seen": by_case(
            geometric_mean,
            {f"{tilt:g}°": (of(f"rl_cost_ratio_at_{level_name(tilt)}"),) for tilt in results.seen_deg},
        ),
        "between": by_case(
            mean,
            {
                f"{name}, {model}": (of(f"rl_between_{model}", name),)
                for name in executed
                for model in ((BEFORE, AFTER) if form == "text" else (AFTER,))  # before, both are the same
            },
        ),
        "level_board": geometric_mean(of("rl_over_nominal_0")),
        "search": by_case(
            geometric_mean,
            {name: (of("search_cost_pi2", name) / of("search_cost_cma_es", name),) for name in refined},
        ),
    }
    if form == "text":  # before refinement both are the same, and cost more than after
        found["nominal_is_worst"] = by_case(
            geometric_mean, {name: (of("rl_over_nominal_max", name),) for name in executed}
        )
    return {f"{name}_{form}": one for name, one in found.items()}


def population_metrics(studies: Studies, numbers: Sequence[int]) -> Metrics:
    """`rl_cost_ratio_prim<number>_mean` and `_worst` over people, `seen_cost_ratio_mean`.

    Means are geometric; `seen_cost_ratio_mean` is that of `seen_cost_ratio_after_over_before_max`. Numbers of
    the text's form end with `_text`. Nothing where no people were studied.

    `studies`: by name.
    """
    values: Metrics = {}
    for form, people in _by_form(studies, numbers[0]).items():
        ending = "" if form == "ours" else f"_{form}"
        for number in numbers:
            ratios = people.values(form, f"rl_cost_ratio_prim{number}")
            values[f"rl_cost_ratio_prim{number}_mean{ending}"] = geometric_mean(ratios).value
            values[f"rl_cost_ratio_prim{number}_worst{ending}"] = float(ratios.max())
        seen = people.values(form, "seen_cost_ratio_after_over_before_max")
        values[f"seen_cost_ratio_mean{ending}"] = geometric_mean(seen).value
    return values


def study_tables(studies: Studies, numbers: Mapping[str, int]) -> dict[str, Table]:
    """A row per variant of the two studies of parameters, mean and interval over the exploration's seeds.

    `studies`: by name; tables of those that were not run are left out. `numbers`: of the refined primitives,
    from 1, by name.
    """
    costs = {f"rl_cost_ratio_prim{number}": f"{name}: cost" for name, number in numbers.items()}
    costs |= {"seen_cost_ratio_after_over_before_max": "seen: cost"}
    searched = {f"search_cost_pi2_prim{number}": f"{name}: search (rad)" for name, number in numbers.items()}
    shown = {"refinement_added": (ADDED, costs), "refinement_exploration": (EXPLORATION, costs | searched)}
    return {
        table: study.summary(columns)
        for table, (name, columns) in shown.items()
        if (study := studies.get(name)) is not None
    }
