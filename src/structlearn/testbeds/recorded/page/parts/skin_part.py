"""A magnetic skin that was pressed at known places: is its map the skin, and can one servo in it?"""

from structlearn.ground.artefacts import Metrics
from structlearn.reporting.claims import Found
from structlearn.reporting.document import Table
from structlearn.testbeds.recorded.page.parts.part import Part, Pictures
from structlearn.testbeds.recorded.page.parts.skin_evidence import skin_evidence
from structlearn.testbeds.recorded.page.parts.skin_figures import skin_pictures
from structlearn.testbeds.recorded.page.parts.skin_results import (
    SkinResults,
    skin_facts,
    skin_metrics,
    skin_tables,
)
from structlearn.testbeds.recorded.page.results import RecordedResults

KEY = "recorded_skin"


def found(results: RecordedResults) -> SkinResults:
    """What the stage wrote, and the runs that it was tuned on."""
    return SkinResults(results.of_set("skin_"), results.parameters[KEY].tuned_on)


def metrics(results: RecordedResults) -> Metrics:
    """Of the structured latent space and its rivals."""
    return skin_metrics(found(results))


def evidence(results: RecordedResults) -> dict[str, Found]:
    """By the names of the claims."""
    return skin_evidence(found(results).runs)


def facts(results: RecordedResults) -> dict[str, object]:
    """What its sentences say, under one name."""
    return {"skin": skin_facts(found(results), results.parameters[KEY])}


def tables(results: RecordedResults) -> dict[str, Table]:
    """By name."""
    return skin_tables(found(results))


def pictures(results: RecordedResults) -> Pictures:
    """By name."""
    return skin_pictures(found(results))


PART = Part(
    name="skin",
    heading="A magnetic skin",
    page="skin",
    needs=("skin_errors",),
    parameters=(KEY,),
    metrics=metrics,
    evidence=evidence,
    facts=facts,
    tables=tables,
    pictures=pictures,
)
