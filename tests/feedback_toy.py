"""Corrected demonstrations whose coupling term is known: latents seen through many noisy channels."""

import numpy as np

from structlearn.feedback.coupling_dataset import CouplingDataset, concatenated
from structlearn.primitives import canonical


def toy_dataset(
    demonstrations=4,
    settings=(0.0, 5.0, 10.0),
    samples=(40, 50),
    channels=6,
    latents=3,
    noise=0.05,
    offset=0.1,
    seed=0,
):
    """The target is a nonlinear function of latents and phase; each demonstration has offsets of its own."""
    rng = np.random.default_rng(seed)
    mixing = rng.normal(size=(2 * latents, channels)) * np.linspace(1.0, 0.2, 2 * latents)[:, None]
    parts = []
    for setting in settings:
        for demonstration in range(demonstrations):
            count = int(rng.integers(samples[0], samples[1] + 1))
            t = np.linspace(0.0, 1.0, count)
            p, u = canonical.phase(t, canonical.TAU_PER_DURATION)
            z = np.empty((count, latents))
            z[:, 0] = setting / 5.0 - 1.0
            for index in range(latents):
                wave = np.sin(np.pi * (rng.uniform(0.5, 2.5) * t + rng.uniform(0.0, 2.0)))
                z[:, index] = (z[:, 0] if index == 0 else 0.0) * (0.2 + 0.8 * t) + 0.4 * wave
            seen = np.tanh(np.hstack([z, z * z])) @ mixing
            seen += offset * rng.normal(size=channels) + noise * rng.normal(size=(count, channels))
            target = (
                40.0 * np.tanh(z[:, 0] * np.cos(3.0 * t) + z[:, 1] * z[:, 2] * t) * np.minimum(1.0, 9 * t)
            )
            target += 40.0 * noise * rng.normal(size=count) * (t > 0)
            numbers = np.full(count, setting), np.full(count, demonstration)
            parts.append(CouplingDataset(50.0 * seen, p, u, target, *numbers, t * count / 100.0))
    return concatenated(parts)
