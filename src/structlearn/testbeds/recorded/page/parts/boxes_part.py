"""People past boxes: one obstacle's features, and a look ahead at the whole scene."""

from structlearn.reporting.claims import Evidence, Found, difference, exact, rate_difference
from structlearn.reporting.document import Table
from structlearn.reporting.scene_ways import NONE, OURS, PLANNED, TEXT, SceneWays
from structlearn.testbeds.recorded import names
from structlearn.testbeds.recorded.files import SETS
from structlearn.testbeds.recorded.page.parts.avoidance_part import listed
from structlearn.testbeds.recorded.page.parts.boxes_figures import boxes_pictures
from structlearn.testbeds.recorded.page.parts.boxes_results import AXES, BoxesFound, boxes_metrics
from structlearn.testbeds.recorded.page.parts.part import Part, of
from structlearn.testbeds.recorded.page.results import RecordedResults
from structlearn.testbeds.recorded.page.tables import shown

KEY = "recorded_boxes"


def found_of(results: RecordedResults) -> BoxesFound:
    """What the stage wrote."""
    return BoxesFound(results.of_set("boxes_"))


def facts(results: RecordedResults) -> dict[str, object]:
    """What its sentences say, under one name."""
    found = found_of(results)
    return {
        "boxes": {
            "found": found,
            "chosen": results.parameters[KEY],
            "errors_of": lambda way: listed(found.nmse.loc[way]),
        }
    }


def boxes_tables(found: BoxesFound) -> dict[str, Table]:
    """By name."""
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


def boxes_evidence(found: SceneWays) -> dict[str, Found]:
    """What was found, by the names that `boxes_claims.yaml` uses."""
    return {
        "text_hits": found.share("hit", TEXT),
        "text_hits_fewer": fewer(found, NONE, TEXT),
        "text_hits_fewer_than_rai": fewer(found, "human_inspired", TEXT),
        "text_goal": furthest(found, TEXT),
        "hits": found.share("hit"),
        "hits_blocked": found.share("hit", blocked=True),
        "goal": furthest(found, OURS),
        "path": found.mean_path(),
        "same_gap": found.share("same_gaps"),
        "features_alone": fewer(found, "text_ensemble", OURS),
        "nearer_than_planned": difference(*(found.by_person(way, "path_mm") for way in (PLANNED, OURS))),
    }


def fewer(found: SceneWays, first: str, second: str) -> Evidence:
    """Reaches that touch a box by the first way minus those by the second, in %, in pairs by person."""
    return rate_difference(*(found.by_person(way, "hit") for way in (first, second)))


def furthest(found: SceneWays, way: str) -> Evidence:
    """Largest distance from the goal at the prescribed end, mm."""
    left = found.of(way)["left_mm"]
    return exact(left.max(), len(left))


PART = Part(
    name="boxes",
    heading="People past boxes",
    page="boxes",
    needs=tuple(f"boxes_{table}" for table in SETS["boxes"]),
    parameters=(KEY,),
    metrics=of(found_of, boxes_metrics),
    evidence=of(found_of, boxes_evidence),
    facts=facts,
    tables=of(found_of, boxes_tables),
    pictures=of(found_of, boxes_pictures),
)
