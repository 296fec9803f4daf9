"""No claim of any page is safe: its own evidence says "no" of some tables that could have been measured.

The evidence functions of all pages are fed the made-up tables of the pages' tests, in which measurements are
inverted, noise, raised or lowered, everywhere or of one method alone, or the methods' names are exchanged.
What is known before anything is measured (times, settings, seeds) stays as it is. A case of a claim that none
of this turns into "no" says nothing: the claim is mended, or marked `by_construction`.
"""

import re
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import partial
from importlib.resources import files
from itertools import chain, product
from typing import Any

import dynamics_tables
import motion_tables
import numpy as np
import pandas as pd
import pytest
import test_scraping_page
import test_servoing_page
import test_tasks_obstacles
import test_touch_page
from committed import ROOT, committed_entry
from reporting_feedback import feedback_stages
from reporting_refinement import refinement_stages, stored
from reporting_scraping import PARAMETERS, demonstration
from test_obstacles_page import find_among_many as obstacles_findings
from test_obstacles_page import results as obstacles_results  # noqa: F401 a fixture

from dissertation.dynamics.protocol.trainings import PLAIN
from dissertation.evidence.claims import NO, Claim, read_claims
from dissertation.recorded.coupling.page import representation_findings
from dissertation.scraping.protocol.cut_sweep import downsampling_effect
from structlearn.reporting.evidence import Evidence, Found
from structlearn.tasks.motion.motion_results import MotionResults, motion_findings
from structlearn.tasks.obstacles.page import SceneWays, scene_findings

KNOWN = re.compile(
    r"time_s|since_s|start_s|end_s|phase|fraction|noise_mm|setting_deg|tilt|factor|quoted|truth|true_.*|.*frequency.*"
)
"""Columns of numbers that are not measured: times, settings, and what the simulator or a maker says."""

LABELS = ("structure", "with_loss", "resting", "blocked", "payload", "assumed", "met")
"""Columns of yes and no that are not measured but say what was tried."""

MOST_LABELS = 20
"""Columns of text with more than so many values name runs, not methods."""

Tables = dict[str, pd.DataFrame]
Case = tuple[str, str]  # name of the evidence for a claim, and one of its cases


@dataclass(frozen=True)
class Page:
    """Claims, results with tables anywhere in them, by pytest's `getfixturevalue`, and what finds evidence.

    Tables at places that are not `chosen` stay; `known` names further columns that are not measured.
    """

    claims: Sequence[Claim]
    results: Callable[[Callable[[str], Any]], Sequence[Any]]
    evidence: Callable[[Any], Mapping[str, Found]]
    chosen: Callable[[str], bool] = lambda place: True
    known: Callable[[], Mapping[str, set[str]]] = dict


def dynamics() -> list[Any]:
    """Five seeds and robots; and the same where networks met the criterion with the plain loss too."""
    made = {
        name: pd.concat(
            [table.assign(seed=table["seed"] + 100 * more) for more in range(4)], ignore_index=True
        )
        if "seed" in table
        else table
        for name, table in dynamics_tables.dynamics_tables().items()
    }
    scores = made["scores"]
    there = set(scores.loc[scores["form"] == PLAIN, "model"])
    learned = scores[(scores["form"] != "") & ~scores["model"].isin(there)].assign(form=PLAIN)
    outcomes = made["outcomes"].assign(met=True)
    return [made | {"scores": pd.concat([scores, learned]), "outcomes": outcomes}, made]


def arithmetic() -> dict[str, set[str]]:
    """Columns of the table on down-sampling that are the same whatever was recorded."""
    first, second = (
        downsampling_effect([demonstration(seed) for seed in seeds], PARAMETERS, (1, 2))
        for seeds in (range(2), range(3, 5))
    )
    same = {name for name in first if first[name].equals(second[name])}
    return {"tables.downsampling": same, "tables.downsampling_people": {"work"}}  # cells are counted


def deaf_to_phase(results: Any) -> Any:
    """The same with networks whose nodes weigh the same at every phase."""
    alike = {
        name: replace(its, phase_weights=np.tile(its.phase_weights[:1], (len(its.phase_weights), 1)))
        for name, its in results.networks.items()
    }
    return replace(results, networks=alike)


FOLLOWS = {"links": {"positive_mass", "positive_definite", "triangle"}, "gravity": {"limit_n_m"}}
"""Columns of tables of arms that follow from how Cov writes a link, or from the URDF: not measured."""

FEWER_DRAWS = 100  # of blocks, for intervals


def of_package(name: str, file: str = "claims.yaml") -> list[Claim]:
    return read_claims(files(f"dissertation.{name}") / file)


def of_task(name: str) -> list[Claim]:
    return read_claims(ROOT / f"src/dissertation/recorded/claims/{name}.yaml")


def motion_page(name: str) -> Page:
    parameters = committed_entry(name, draws=FEWER_DRAWS)
    return Page(
        of_task(name),
        lambda get: [motion_tables.made_up(name)],
        lambda its: motion_findings(MotionResults(its, parameters)),
        known=lambda: FOLLOWS,
    )


SCRAPING = "scraping.page"
FEEDBACK_TABLES, REFINEMENT_TABLES = (stages()[1].keys() for stages in (feedback_stages, refinement_stages))
MADE_UP = {
    "boxes": (test_tasks_obstacles.made_up_ways, lambda its: scene_findings(SceneWays(its))),
    "avoidance": (test_tasks_obstacles.made_up_scores, representation_findings),
} | {name: (made, test_touch_page.FIND[name]) for name, made in test_touch_page.MADE_UP.items()}
PAGES = {
    "dynamics": Page(of_package("dynamics.page"), lambda get: dynamics(), dynamics_tables.findings_of),
    "obstacles": Page(
        of_package("obstacles.page"),
        lambda get: [get("obstacles_results")],
        obstacles_findings,
    ),
    "servoing": Page(
        of_package("servoing.page"),
        lambda get: [
            {"results": test_servoing_page.people(reached)}
            for reached in (test_servoing_page.CRITICAL, test_servoing_page.HARMFUL)
        ],
        lambda its: test_servoing_page.found(its["results"]),
        known=lambda: {"results": {"steps"}},
    ),
    "segmentation": Page(
        of_package(SCRAPING, "segmentation_claims.yaml"),
        lambda get: [stored()],
        partial(test_scraping_page.evidence, "segmentation"),
        known=arithmetic,
        chosen=lambda place: place.rpartition(".")[2] not in FEEDBACK_TABLES | REFINEMENT_TABLES,
    ),
    "feedback": Page(
        of_package(SCRAPING, "feedback_claims.yaml"),
        lambda get: [stored(), deaf_to_phase(stored())],
        partial(test_scraping_page.evidence, "feedback"),
        chosen=lambda place: place.removeprefix("tables.") in FEEDBACK_TABLES,
    ),
    "refinement": Page(
        of_package(SCRAPING, "refinement_claims.yaml"),
        lambda get: [stored()],
        partial(test_scraping_page.evidence, "refinement"),
        chosen=lambda place: place.removeprefix("tables.") in REFINEMENT_TABLES,
    ),
    **{
        name: Page(of_task(name), lambda get, made=made: [made()], find)
        for name, (made, find) in MADE_UP.items()
    },
    **{name: motion_page(name) for name in motion_tables.JOINTS},
}


def parts(results: Any) -> Mapping[str, Any]:
    """What dataclasses and mappings hold by name."""
    if is_dataclass(results):
        return {one.name: getattr(results, one.name) for one in fields(results)}
    return results if isinstance(results, Mapping) else {}


def tables(results: Any, place: str = "") -> Tables:
    """All tables anywhere in results, by their place: `models.forward`."""
    if isinstance(results, pd.DataFrame):
        return {place: results}
    found = {}
    for name, part in parts(results).items():
        found |= tables(part, f"{place}.{name}".strip("."))
    return found


def with_tables(results: Any, changed: Tables, place: str = "") -> Any:
    """The same results with some tables replaced, by their place."""
    if place in changed:
        return changed[place]
    new = {}
    for name, part in parts(results).items():
        below = f"{place}.{name}".strip(".")
        if any(f"{one}.".startswith(f"{below}.") for one in changed):
            new[name] = with_tables(part, changed, below)
    return replace(results, **new) if is_dataclass(results) else {**results, **new}


def permuted(values: pd.Series) -> pd.Series:
    """The same values in another order."""
    return values.sample(frac=1.0, random_state=zlib.crc32(str(values.name).encode())).set_axis(values.index)


def noise(values: pd.Series) -> pd.Series:
    """Coins, or numbers about 1 or 0."""
    rng = np.random.default_rng(zlib.crc32(str(values.name).encode()))
    if values.dtype == bool:
        return pd.Series(rng.random(len(values)) < 0.5, values.index)
    drawn = pd.Series(rng.normal(size=len(values)), values.index)
    return np.exp(drawn) if (values.dropna() >= 0).all() else drawn


def either(of_booleans: Callable, of_numbers: Callable) -> Callable[[pd.Series], pd.Series]:
    return lambda values: (of_booleans if values.dtype == bool else of_numbers)(values)


def place(values: pd.Series) -> np.ndarray:
    """From 0 in the first row to 1 in the last."""
    return np.linspace(0.0, 1.0, len(values))


negated = either(lambda its: ~its, lambda its: -its)
inverted = either(lambda its: ~its, lambda its: 1.0 / its)
falling = either(lambda its: its & (place(its) < 0.5), lambda its: its * np.exp(-2.0 * place(its)))
raised = either(lambda its: its | True, lambda its: 1e3 * (1.0 + its.abs()))  # which differ as they did
lowered = either(lambda its: its & False, lambda its: 1e-3 * its)
HOW = (noise, lowered, raised, falling, permuted, inverted, negated)
"""Ways to change what was measured; yes and no are changed as the first function of each says."""


def measured(table: pd.DataFrame, known: set[str] = frozenset()) -> list[str]:
    """Columns that hold what was measured."""
    return [
        name
        for name in table.select_dtypes([float, bool])
        if not KNOWN.fullmatch(name) and name not in LABELS and name not in known
    ]


def labels(table: pd.DataFrame) -> dict[str, list[object]]:
    """Columns that say what was tried, with their values."""
    found = {}
    for name in table.columns:
        if name in LABELS or not pd.api.types.is_numeric_dtype(table[name]):
            values = list(table[name].dropna().unique())
            if 1 < len(values) <= MOST_LABELS:
                found[name] = values
    return found


def changes(place: str, table: pd.DataFrame, names: Sequence[str]) -> Iterator[Iterable[Tables]]:
    """A table with methods exchanged, or with one of them or one of the measured columns `names` changed.

    In groups: where the first of a group leaves all evidence as it was, so do the others.
    """

    def change(how: Callable, names: Sequence[str], rows: pd.Series | None = None) -> Tables:
        new = {name: how(table[name]) for name in names}
        if rows is not None:
            new = {name: table[name].where(~rows, values) for name, values in new.items()}
        return {place: table.assign(**new)}

    def exchange(label: str, values: list[object], others: list[object]) -> Tables:
        return {place: table.assign(**{label: table[label].map(dict(zip(values, others, strict=True)))})}

    for label, values in labels(table).items():
        others = (values[shift:] + values[:shift] for shift in range(1, len(values)))
        yield map(partial(exchange, label, values), others)
    for label, values in labels(table).items():
        yield from (
            [change(how, names, table[label] == value)] for value, how in product(values, (raised, lowered))
        )
    yield from (map(partial(change, names=[name]), HOW) for name in names)


def with_other(how: Callable, every: Tables, columns: Mapping[str, Sequence[str]]) -> Tables:
    """Tables with all that is measured changed in one way; `columns` by table."""
    return {
        place: table.assign(**{name: how(table[name]) for name in columns[place]})
        for place, table in every.items()
    }


def never_no(page: Page, get: Callable[[str], Any]) -> tuple[set[Case], set[Case]]:
    """All cases of a page's claims, and those that no change turns into a "no".

    Changes are tried until all cases are found that do not hold by construction.
    """
    several = page.results(get)
    every = set(found_for(page, page.evidence(several[0])))
    left = set(every)
    for results in several:
        search(page, results, left)
    return every, left


def search(page: Page, results: Any, left: set[Case]) -> None:
    """Take away the cases that some change of the results turns into a "no"."""
    known, firm = page.known(), {claim.evidence for claim in page.claims if claim.by_construction}
    every = {place: table for place, table in tables(results).items() if page.chosen(place)}
    columns = {place: measured(table, known.get(place, set())) for place, table in every.items()}

    def found(changed: Tables) -> Mapping[Case, Evidence]:
        try:
            with np.errstate(all="ignore"):
                its = found_for(page, page.evidence(with_tables(results, changed)))
        except (KeyError, ValueError, IndexError, ZeroDivisionError, OverflowError):
            return {}  # nobody can have measured such tables
        for claim in page.claims:
            own = {key: one for key, one in its.items() if key[0] == claim.evidence}
            left.difference_update(key for key, one in own.items() if claim.verdict(one, key[1]) == NO)
        return its

    begun = found({})

    def resting(its: Mapping[Case, Evidence]) -> set[Case]:
        """Cases left whose evidence is another one now."""
        return {case for case in left if repr(its.get(case)) != repr(begun.get(case))}

    for how in HOW:
        found(with_other(how, every, columns))
    for place, table in reversed(every.items()):
        one = {place: table}
        tried = [found(with_other(how, one, columns)) for how in (noise, raised) if left and columns[place]]
        tried = [its for its in tried if its]
        rest_on_it = set().union(*map(resting, tried)) if tried else set(left)
        whole = ([with_other(how, one, columns)] for how in HOW if how not in (noise, raised))
        for group in chain(whole, changes(place, table, columns[place])):
            if not any(case[0] not in firm for case in left & rest_on_it):
                break
            for number, changed in enumerate(group):
                its = found(changed)
                if number == 0 and its and not resting(its) & rest_on_it:
                    break


def found_for(page: Page, found: Mapping[str, Found]) -> dict[Case, Evidence]:
    """Evidence for the cases of all claims."""
    return {
        (claim.evidence, case): one
        for claim in page.claims
        for case, one in cases(found.get(claim.evidence, {})).items()
    }


def cases(found: Found) -> Mapping[str, Evidence]:
    return {"": found} if isinstance(found, Evidence) else found


@pytest.fixture(scope="module")
def unmoved():
    """What `never_no` finds, by page: claims of a page are looked at together.

    Text of tables is that of Python, not of Arrow: of so few rows that takes a fifth less.
    """
    with pd.option_context("mode.string_storage", "python"):
        yield {}


@pytest.mark.parametrize(
    ("page", "claim"),
    [
        pytest.param(name, claim, id=f"{name}: {claim.evidence}")
        for name, page in PAGES.items()
        for claim in page.claims
    ],
)
def test_every_case_of_a_claim_can_come_out_no(page, claim, unmoved, request):
    if page not in unmoved:
        unmoved[page] = never_no(PAGES[page], request.getfixturevalue)
    every, never = ({case for name, case in its if name == claim.evidence} for its in unmoved[page])
    assert never == (every if claim.by_construction else set())
