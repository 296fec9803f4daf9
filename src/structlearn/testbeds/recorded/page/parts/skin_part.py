"""A magnetic skin that was pressed at known places: is its map the skin, and can one servo in it?"""

from structlearn.testbeds.recorded.page.parts.part import Part, of
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


def facts(results: RecordedResults) -> dict[str, object]:
    """What its sentences say, under one name."""
    return {"skin": skin_facts(found(results), results.parameters[KEY])}


PART = Part(
    name="skin",
    heading="A magnetic skin",
    page="skin",
    needs=("skin_errors",),
    parameters=(KEY,),
    metrics=of(found, skin_metrics),
    evidence=of(found, lambda its: skin_evidence(its.runs)),
    facts=facts,
    tables=of(found, skin_tables),
    pictures=of(found, skin_pictures),
)
