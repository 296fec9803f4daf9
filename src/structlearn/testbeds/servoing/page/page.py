"""The page of the servoing testbed: what its template may name."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from structlearn.reporting.claims import judge, read_claims
from structlearn.reporting.document import Document, Source, Table, environment
from structlearn.reporting.findings import Findings
from structlearn.reporting.studies import rests_on
from structlearn.testbeds.servoing import names
from structlearn.testbeds.servoing.files import MADE_BY
from structlearn.testbeds.servoing.page.results import PEOPLE_STUDY, PUBLISHED, ServoingResults
from structlearn.testbeds.servoing.page.tables import test_chains
from structlearn.testbeds.servoing.protocol.model_scores import SQUARE_MM, TEST_CHAIN, contact_bias

PACKAGE = "structlearn.testbeds.servoing.page"


def document(results: ServoingResults, find: Findings, shown: Mapping[str, Table]) -> Document:
    """The page with its verdicts; figures are those of `figures.drawings`, `shown` those of `tables`."""
    errors = results.contact_errors
    squares = np.square(errors[["along_mm", "across_mm"]]).to_numpy().sum()
    facts = {
        "published": PUBLISHED,
        "results": results,
        "models": results.models,
        "trials": results.trials,
        "chosen": results.chosen,
        "names": names,
        "found": find,
        "tested": test_chains(results).itertuples,
        "test_chain": TEST_CHAIN,
        "square_mm": SQUARE_MM,
        "fixed_share": contact_bias(errors)["squared_mm2"].sum() / squares,
    }
    claims = read_claims(Path(__file__).with_name("claims.yaml"))
    return Document(
        template="servoing.html.jinja",
        package=PACKAGE,
        stage="servoing_report",
        facts=facts,
        tables=shown,
        judged=judge(claims, find, environment(PACKAGE), facts),
        sources={name: Source(*made) for name, made in MADE_BY.items()},
        parameters=results.chosen,
        recordings="../rerun/servoing",
        simulated=True,
        basis=rests_on(PEOPLE_STUDY, results.people.study),
    )
