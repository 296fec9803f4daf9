"""Which hidden nodes of a network dominate at each phase (IV.9.3.4, figure IV.16 bottom)."""

import numpy as np

from structlearn.feedback.coupling_model import CouplingModel

DOMINANT = 10  # nodes per phase kernel, as in the figure


def dominant_nodes(network: CouplingModel) -> np.ndarray | None:
    """Mask (N, H) of the ten nodes with the largest |weight| into each phase kernel.

    None if the network has no phase kernels.
    """
    weights = network.arrays().get("phase_weights")
    if weights is None:
        return None
    order = np.argsort(-np.abs(weights), axis=1, kind="stable")
    dominant = np.zeros(weights.shape, dtype=bool)
    np.put_along_axis(dominant, order[:, :DOMINANT], True, axis=1)
    return dominant


def shared_nodes(dominant: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Number of dominant nodes that each pair of phase kernels shares, and the kernels' distance."""
    first, second = np.triu_indices(len(dominant), 1)
    return (dominant.astype(int) @ dominant.T.astype(int))[first, second], second - first


def sharing_over_phase(dominant: np.ndarray) -> float:
    """Correlation, over pairs of phase kernels, of the number of shared dominant nodes with kernel distance.

    Negative if nodes come and go with the phase; 0 on average for permuted kernels or weights, and 0 if the
    nodes are the same at every phase. `dominant`: (N, H) of `dominant_nodes`.
    """
    shared, distance = shared_nodes(dominant)
    return float(np.corrcoef(shared, distance)[0, 1]) if np.ptp(shared) else 0.0
