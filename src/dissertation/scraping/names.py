"""Names, order and colours of executions, models and methods, for the pages and the recordings."""

from collections.abc import Sequence

from dissertation.scraping.protocol.execution_scores import AFTER, BEFORE, NOMINAL
from dissertation.scraping.protocol.feedback_models import LEVEL, NETWORKS, POINTWISE, UNROLLED
from dissertation.scraping.protocol.sample_efficiency import CMA_ES, PI2
from structlearn.palette import (
    BLUE,
    GOOD,
    GREY,
    LIGHT_BLUE,
    METHOD_COLOURS,
    METHOD_NAMES,
    OCHRE,
    OURS,
    PINK,
    PUBLISHED,
    WITHOUT,
    Look,
)
from structlearn.policy_search.refinement import FEEDBACK, IMPROVED, SAMPLE

CORRECTED = "corrected"
"""Key of executions corrected by a person."""

RUNS = {
    NOMINAL: Look("no feedback", WITHOUT),
    CORRECTED: Look("corrected by a person", GOOD),
    POINTWISE: Look("feedback, trained pointwise", PUBLISHED),
    LEVEL: Look("feedback, level board too", OURS),
    UNROLLED: Look("feedback, trained in the unroll", PINK),
    BEFORE: Look("before refinement", LIGHT_BLUE),
    AFTER: Look("after refinement", PINK),
}
"""Kinds of executions, in order."""

REPRESENTATIONS = {
    "pmnn_100": Look("PMNN, 100 nodes", BLUE),
    "pmnn_6": Look("PMNN, 6 nodes", LIGHT_BLUE),
    "pmnn_0": Look("PMNN, no hidden layer", LIGHT_BLUE),
    "ffnn_phase": Look("FFNN with phase", OCHRE),
    "ffnn": Look("FFNN", OCHRE),
    "pca": Look("PCA, then phase kernels", PINK),
    "autoencoder": Look("autoencoder, then phase kernels", PINK),
}
"""Representations of the feedback model, keyed as in `feedback_models`."""

CUT_METHODS = {method: Look(name, METHOD_COLOURS[method]) for method, name in METHOD_NAMES.items()}
"""Methods of finding cut points."""

ROLLOUTS = {
    SAMPLE: Look("drawn policies", GREY),
    IMPROVED: Look("improved policy", OCHRE),
    FEEDBACK: Look("with the network", PINK),
}
"""Kinds of rollouts in refinement by trial."""

SEARCHES = {PI2: Look("PI2-CMA", BLUE), CMA_ES: Look("CMA-ES", OCHRE)}
"""Policy search methods."""


def primitive_title(primitives: Sequence[str], name: str) -> str:
    """Title such as `turn (primitive 2)`, counted as in the dissertation."""
    return f"{name} (primitive {list(primitives).index(name) + 1})"


def network_name(trainer: str, hidden: Sequence[int]) -> str:
    """Name of a network by its trainer and hidden layers; of one's own, the trainer's."""
    known = {its: REPRESENTATIONS[key].name for key, its in NETWORKS.items()}
    return known.get((trainer, tuple(hidden)), trainer)
