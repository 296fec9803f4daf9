"""The page of the servoing testbed: what its template may name."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from structlearn.core.metrics import mean_interval
from structlearn.reporting.claims import Evidence, in_words, judge, mean, read_claims
from structlearn.reporting.document import Document, Source, Table, environment
from structlearn.reporting.prose import with_interval
from structlearn.reporting.studies import rests_on
from structlearn.testbeds.servoing import names
from structlearn.testbeds.servoing.files import MADE_BY
from structlearn.testbeds.servoing.page import tables
from structlearn.testbeds.servoing.page.evidence import TEXT_LL, evidence, over_people, rate, rate_of_people
from structlearn.testbeds.servoing.page.results import AS_IT_STANDS, PUBLISHED, ServoingResults
from structlearn.testbeds.servoing.protocol.model_scores import SQUARE_MM, TEST_CHAIN, contact_bias
from structlearn.testbeds.servoing.protocol.servo_scores import ControllerScores
from structlearn.testbeds.servoing.protocol.servo_variants import AS_DATA, CHANGES, Variant

PACKAGE = "structlearn.testbeds.servoing.page"


def document(results: ServoingResults, shown: Mapping[str, Table]) -> Document:
    """The page with its verdicts.

    `results`: what it shows; figures are those of `figures.drawings`; `shown`: tables of `tables.tables`.
    """
    facts = _facts(results)
    claims = read_claims(Path(__file__).with_name("claims.yaml"))
    return Document(
        template="servoing.html.jinja",
        package=PACKAGE,
        stage="servoing_report",
        facts=facts,
        tables=shown,
        judged=judge(claims, evidence(results), environment(PACKAGE), facts),
        sources={name: Source(*made) for name, made in MADE_BY.items()},
        parameters=results.chosen,
        recordings="../rerun/servoing",
        simulated=True,
        basis=rests_on("servoing/people", results.people),
    )


def _facts(results: ServoingResults) -> dict[str, object]:
    facts = {
        "published": PUBLISHED,
        "results": results,
        "models": results.models,
        "trials": results.trials,
        "chosen": results.chosen,
        "names": names,
        "tested": tables.test_chains(results).itertuples,
        "test_chain": TEST_CHAIN,
        "changes": CHANGES,
        "as_data": AS_DATA,
        "square_mm": SQUARE_MM,
        "like": replace,
        "over_seeds": over_seeds,
        "reached": reached,
        "text_ll": TEXT_LL,
        "mean_of_people": lambda key, number_format: in_words(
            over_people(mean, results.of_people(key)), number_format
        ),
        "people_count": len(results.people.values(AS_IT_STANDS, "repeat")) if results.people else 0,
        "over_people": lambda variant, skin="": share_in_sentence(rate_of_people(results, variant, skin)),
    }
    errors = results.contact_errors
    squares = np.square(errors[["along_mm", "across_mm"]]).to_numpy().sum()
    return facts | {"fixed_share": contact_bias(errors)["squared_mm2"].sum() / squares}


def over_seeds(values: np.ndarray, number_format: str) -> str:
    """`0.36 [0.30, 0.42]`: mean of values (S,) with its 95 % interval."""
    return with_interval(*mean_interval(values), number_format)


def share_in_sentence(found: Evidence) -> str:
    """`32.2 % [15.4, 48.9]`: a share with its interval over people; the sentence says of whom it is."""
    return in_words(replace(found, people=None), "share")


def reached(trials: ControllerScores, variant: Variant) -> str:
    """`99.8 % [98.9, 100.0]`: share of targets that a controller reaches, with its interval."""
    return in_words(rate(trials, variant), "share")
