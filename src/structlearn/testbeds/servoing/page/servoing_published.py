"""Numbers on latent-space tactile servoing as the dissertation prints them (section II.4)."""

SAMPLES, PAIRS = 55431, 183825
"""Samples of touch and pairs (s_t-1, a_t-1, s_t, a_t, s_t+1) of the recorded demonstrations (II.4.1.1)."""

RECONSTRUCTION_NMSE, DISTANCES_NMSE = 0.25, 0.02
"""All splits are below: the autoencoder (II.4.2), and map against geodesic distances (II.4.3)."""

ITERATIONS = 200_000
"""Steps of both optimisers (II.4.1.3)."""

TEST_CHAIN = 3
"""Steps of prediction on which forward models are tested; they learn from two (II.4.4)."""
