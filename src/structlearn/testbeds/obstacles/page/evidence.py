"""What was found for the claims of `claims.yaml`.

The dissertation's statements on hits and goals are held against unrolls with its own rules; unrolls with
limits at the goal are evidence for this project's claims alone. Its networks of many settings are single
ones: where the mean of several was trained, what it says of them is not tested.
"""

from structlearn.avoidance.learned_models import ALL, HUMAN_INSPIRED, NETWORK, SETTING
from structlearn.avoidance.shapes import SHAPES
from structlearn.reporting.claims import UNKNOWN, Evidence, Found, counted, difference, exact, mean
from structlearn.testbeds.obstacles.names import KINDS
from structlearn.testbeds.obstacles.page.results import ObstacleResults
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import LIMITED, PUBLISHED, TRAINED, UNSEEN

PARTS = {"learned from": "train", "held out": "test"}


def evidence(results: ObstacleResults) -> dict[str, Found]:
    """By the names that the claims use."""
    networks = {shape: results.fit(NETWORK, shape, shape) for shape in SHAPES}
    across = {
        "network": [row["nmse_across"] for row in networks.values()],
        "all": [results.fit(NETWORK, ALL, shape)["nmse_across"] for shape in SHAPES],
        "rai": [results.fit(HUMAN_INSPIRED, shape, shape)["nmse_across"] for shape in SHAPES],
    }
    trained = {shape: _hits(results, TRAINED, NETWORK, [shape]) for shape in SHAPES}
    unseen = {shape: _hits(results, UNSEEN, NETWORK, [shape]) for shape in SHAPES}
    deterioration = difference(across["all"], across["network"])
    single = results.members == 1
    goals = results.limited[["goal_distance_m", "late_goal_distance_m"]].max()
    return {
        "hits_per_setting": _hits(results, TRAINED, NETWORK, [SETTING]),
        "hits_of_rai": _hits(results, TRAINED, HUMAN_INSPIRED, [SETTING]),
        "single_hits_per_shape": trained if single else UNKNOWN,
        "hits_per_shape": trained,
        "single_hits_unseen": unseen if single else UNKNOWN,
        "hits_unseen": unseen,
        "hits_with_limits": {
            "per setting": _hits(results, TRAINED, NETWORK, [SETTING], LIMITED),
            "per shape": _hits(results, TRAINED, NETWORK, SHAPES, LIMITED),
            "unseen spheres": _hits(results, UNSEEN, NETWORK, SHAPES, LIMITED),
        },
        "largest_errors": {words: _largest(results, "nmse", part) for words, part in PARTS.items()},
        "largest_dominant": {
            words: _largest(results, "nmse_dominant", part) for words, part in PARTS.items()
        },
        "rai_fits_worse": {words: _gain(results, "nmse", part) for words, part in PARTS.items()},
        "rai_dominant": {words: _gain(results, "nmse_dominant", part) for words, part in PARTS.items()},
        "rai_across_settings": mean(across["rai"]),
        "rai_over_network": difference(across["rai"], across["network"]),
        "error_per_shape": {
            shape: exact(row["nmse_worse"], len(results.rows(TRAINED, NETWORK, shape)))
            for shape, row in networks.items()
        },
        "goal_by_the_text": {
            KINDS[kind].name: _farthest(results, kind) for kind in (NETWORK, HUMAN_INSPIRED)
        },
        "goal_with_limits": {
            words: exact(100 * goal, len(results.limited))
            for words, goal in zip(("prescribed time", "1.5 times it"), goals, strict=True)
        },
        "excursions": exact(100 * results.excursions.max(), len(results.limited)),
        "single_of_all_shapes": deterioration if single else UNKNOWN,
        "network_of_all_shapes": deterioration,
    }


def _hits(
    results: ObstacleResults, protocol: str, kind: str, sources: list[str], rules: str = PUBLISHED
) -> Evidence:
    scored = results.rows(protocol, kind, sources, rules)
    return counted(int(scored["hit"].sum()), len(scored))


def _farthest(results: ObstacleResults, kind: str) -> Evidence:
    """Largest distance from the goal at the prescribed time with the text's rules, m."""
    distance = results.rows(TRAINED, kind, SETTING, PUBLISHED)["goal_distance_m"]
    return exact(distance.max(), len(distance))


def _largest(results: ObstacleResults, column: str, part: str) -> Evidence:
    """Largest error of the network over the scenarios that have it."""
    errors = results.setting_fits(column, part)
    return exact(errors[NETWORK].max(), len(errors)) if len(errors) else UNKNOWN


def _gain(results: ObstacleResults, column: str, part: str) -> Evidence:
    """Error of Rai et al. minus that of the network, scenario by scenario."""
    errors = results.setting_fits(column, part)
    return difference(errors[HUMAN_INSPIRED], errors[NETWORK]) if len(errors) else UNKNOWN
