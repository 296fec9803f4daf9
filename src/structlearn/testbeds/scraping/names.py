"""Names, order and colours of what is compared on the board, for pages and recordings."""

from collections.abc import Sequence

from structlearn.feedback.feedback_models import LEVEL, POINTWISE, UNROLLED
from structlearn.palette import (
    BLUE,
    GREEN,
    GREY,
    LIGHT_BLUE,
    METHOD_COLOURS,
    METHOD_NAMES,
    OCHRE,
    ORANGE,
    PINK,
    Look,
)
from structlearn.policy_search.refinement import FEEDBACK, IMPROVED, SAMPLE
from structlearn.policy_search.sample_efficiency import CMA_ES, PI2
from structlearn.testbeds.scraping.protocol.execution_scores import AFTER, BEFORE, NOMINAL

CORRECTED = "corrected"
"""Key of the executions corrected by a person."""

RUNS = {
    NOMINAL: Look("no feedback", GREEN),
    CORRECTED: Look("corrected by a person", BLUE),
    POINTWISE: Look("feedback, trained pointwise", ORANGE),
    LEVEL: Look("feedback, level board too", PINK),
    UNROLLED: Look("feedback, trained in the unroll", OCHRE),
    BEFORE: Look("before refinement", LIGHT_BLUE),
    AFTER: Look("after refinement", PINK),
}
"""Kinds of executions in their order."""

PRIMITIVES = ("down", "turn", "scrape")
"""The dissertation's primitives 1, 2 and 3."""

REPRESENTATIONS = {
    "pmnn_100": Look("PMNN, 100 nodes", BLUE),
    "pmnn_6": Look("PMNN, 6 nodes", LIGHT_BLUE),
    "pmnn_0": Look("PMNN, no hidden layer", LIGHT_BLUE),
    "ffnn_phase": Look("FFNN with phase", OCHRE),
    "ffnn": Look("FFNN", OCHRE),
    "pca": Look("PCA, then phase kernels", PINK),
    "autoencoder": Look("autoencoder, then phase kernels", PINK),
}
"""Forms of the feedback model, by the names of `feedback_models`."""

CUT_METHODS = {method: Look(name, METHOD_COLOURS[method]) for method, name in METHOD_NAMES.items()}
"""Methods of finding cut points."""

ROLLOUTS = {
    SAMPLE: Look("drawn policies", GREY),
    IMPROVED: Look("improved policy", OCHRE),
    FEEDBACK: Look("with the network", PINK),
}
"""Executions of a refinement by trial."""

SEARCHES = {PI2: Look("PI2-CMA", BLUE), CMA_ES: Look("CMA-ES", OCHRE)}
"""Policy search methods."""


def primitive_title(primitives: Sequence[str], name: str) -> str:
    """Name and number of a primitive, counted as in the dissertation, e.g. `turn (primitive 2)`."""
    return f"{name} (primitive {list(primitives).index(name) + 1})"
