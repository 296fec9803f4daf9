"""The page on reaches past boxes put together: its tables, claims with verdicts, sources."""

from collections.abc import Mapping
from importlib.resources import files as package_files

from structlearn.ground.params import Parameters
from structlearn.reporting.claims import UNKNOWN, judge, read_claims
from structlearn.reporting.document import Document, Table, environment
from structlearn.testbeds.recorded import names
from structlearn.testbeds.recorded.page.assembly import PACKAGE, listed, source
from structlearn.testbeds.recorded.page.boxes_evidence import boxes_evidence
from structlearn.testbeds.recorded.page.boxes_results import AXES, OURS, BoxesFound, boxes_metrics
from structlearn.testbeds.recorded.page.tables import shown


def boxes_tables(found: BoxesFound) -> dict[str, Table]:
    """By name; none where nothing was recorded."""
    if not found.recorded:
        return {}
    strong = frozenset({found.ways.index(OURS)})
    formats = {"path_mm": ".1f", "goal_max_mm": ".0f", "nearest_mm": ".0f"}
    models = [way for way in found.ways if way in found.nmse.index]
    errors = found.nmse.loc[models].reset_index()
    errors["way"] = [names.BOX_WAYS[way].name for way in models]
    people = found.of(OURS).groupby("person", as_index=False)
    by_person = people.agg(
        reaches=("hit", "size"),
        blocked=("blocked", "sum"),
        touching=("hit", "sum"),
        path_mm=("path_mm", "mean"),
        goal_max_mm=("left_mm", "max"),
        other_gaps=("same_gaps", lambda same: int((~same).sum())),
    )
    return {
        "boxes_ways": shown(found.summary, strong, **formats),
        "boxes_errors": shown(errors, **dict.fromkeys(AXES, ".2f")),
        "boxes_by_person": shown(by_person, path_mm=".1f", goal_max_mm=".0f"),
        "boxes_left_out": Table(found["left_out"]),
        "boxes_reaches": Table(found["reaches"]),
        "boxes_beside_each_other": Table(found["people"]),
    }


def boxes_document(
    found: BoxesFound, tables: Mapping[str, Table], parameters: Mapping[str, Parameters]
) -> Document:
    """The page; parameters by their key in `params.yaml`."""
    claims = read_claims(package_files(PACKAGE) / "boxes_claims.yaml")
    evidence = boxes_evidence(found) if found.recorded else {claim.evidence: UNKNOWN for claim in claims}
    known = {"found": found, "parameters_of": parameters["recorded_boxes"]}
    known |= {"errors_of": lambda way: listed(found.nmse.loc[way])} | boxes_metrics(found)
    return Document(
        template="boxes.html.jinja",
        package=PACKAGE,
        stage="stages/recorded/dvc.yaml:report",
        facts=known,
        tables=tables,
        judged=judge(claims, evidence, environment(PACKAGE), known),
        sources={name: source(f"boxes/{name}") for name in found.tables},
        parameters=parameters,
        recordings="../recordings/recorded",
    )
