"""What was found on reaches past boxes, by the names that `boxes_claims.yaml` uses."""

from structlearn.reporting.claims import Evidence, Found, difference, exact, rate_difference
from structlearn.reporting.scene_ways import NONE, OURS, PLANNED, TEXT, SceneWays


def boxes_evidence(found: SceneWays) -> dict[str, Found]:
    """By the names of the claims."""
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
