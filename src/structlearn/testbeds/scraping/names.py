"""Names, order and colours of what is compared on the board, for pages and recordings alike."""

from collections.abc import Sequence

from structlearn.feedback.feedback_models import LEVEL, POINTWISE, UNROLLED
from structlearn.palette import (
    BLUE,
    GREEN,
    GREY,
    METHOD_COLOURS,
    METHOD_NAMES,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    Look,
)
from structlearn.policy_search.refinement import FEEDBACK, IMPROVED, SAMPLE
from structlearn.policy_search.sample_efficiency import CMA_ES, PI2
from structlearn.testbeds.scraping.protocol.execution_scores import AFTER, BEFORE, NOMINAL

CORRECTED = "corrected"
"""Key of the executions that a person corrects."""

RUNS = {
    NOMINAL: Look("no feedback", GREEN),
    CORRECTED: Look("corrected by a person", BLUE),
    POINTWISE: Look("feedback, trained pointwise", VERMILION),
    LEVEL: Look("feedback, level board too", PURPLE),
    UNROLLED: Look("feedback, trained in the unroll", ORANGE),
    BEFORE: Look("before refinement", SKY),
    AFTER: Look("after refinement", PURPLE),
}
"""Kinds of executions in their order."""

PRIMITIVES = ("down", "turn", "scrape")
"""The dissertation's primitives 1, 2 and 3."""

REPRESENTATIONS = {
    "pmnn_100": Look("PMNN, 100 nodes", BLUE),
    "pmnn_6": Look("PMNN, 6 nodes", SKY),
    "pmnn_0": Look("PMNN, no hidden layer", SKY),
    "ffnn_phase": Look("FFNN with phase", ORANGE),
    "ffnn": Look("FFNN", ORANGE),
    "pca": Look("PCA, then phase kernels", PURPLE),
    "autoencoder": Look("autoencoder, then phase kernels", PURPLE),
}
"""Forms of the feedback model, by the names of `feedback_models`."""

CUT_METHODS = {method: Look(name, METHOD_COLOURS[method]) for method, name in METHOD_NAMES.items()}
"""Ways of finding cut points."""

ROLLOUTS = {
    SAMPLE: Look("drawn policies", GREY),
    IMPROVED: Look("improved policy", ORANGE),
    FEEDBACK: Look("with the network", PURPLE),
}
"""Executions of a refinement by trial."""

SEARCHES = {PI2: Look("PI2-CMA", BLUE), CMA_ES: Look("CMA-ES", ORANGE)}
"""Ways of searching a policy."""


def primitive_title(primitives: Sequence[str], name: str) -> str:
    """`turn (primitive 2)`, counted as in the dissertation."""
    return f"{name} (primitive {list(primitives).index(name) + 1})"
