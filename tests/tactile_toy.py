"""A toy finger for tests: half a cylinder with electrodes, an edge that slides, rolls and presses on it."""

import numpy as np
from scipy.ndimage import gaussian_filter1d

from structlearn.tactile.geodesics import Geodesics
from structlearn.tactile.touch_dataset import OTHER, TEST, TRAIN, VALIDATION, TouchDataset

RADIUS = 0.007
LENGTH = 0.014
RATE_HZ = 100.0


def skin(along: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Points (..., 3) m of the half cylinder."""
    return np.stack([along, RADIUS * np.sin(angle), -RADIUS * np.cos(angle)], axis=-1)


def counts(along: np.ndarray, angle: np.ndarray, force: np.ndarray, electrodes: int) -> np.ndarray:
    """Signals (N, E) of a touch: a saturating bump round the contact, the opposite sign elsewhere."""
    places = np.linspace(0, 1, electrodes)
    centres = skin(LENGTH * places, 1.2 * np.sin(2.4 * np.pi * places))
    squared = np.square(skin(along, angle)[:, None] - centres).sum(axis=-1)
    pressed = force[:, None] * np.exp(-squared / (2 * 0.003**2))
    return -(4000 * 0.35 * pressed / (1 + 0.35 * pressed) - 200 * (1 - np.exp(-force[:, None] / 3)))


def toy_dataset(contacts: int = 30, samples: int = 400, electrodes: int = 19, seed: int = 0) -> TouchDataset:
    """Random smooth contacts; every 7th and 8th of ten are for validation and test."""
    rng = np.random.default_rng(seed)
    walk = gaussian_filter1d(rng.normal(size=(contacts, samples, 3)), 60, axis=1)
    walk = walk / walk.std(axis=1, keepdims=True) * 0.5 + rng.uniform(-0.4, 0.4, (contacts, 1, 3))
    fraction = 0.5 + 0.5 * np.tanh(walk)  # within 0..1, velocities to match
    along, angle = LENGTH * fraction[..., 0], 2.2 * fraction[..., 1] - 1.1
    force = 0.6 + 1.6 * fraction[..., 2]
    rate = np.stack([np.gradient(one, 1 / RATE_HZ, axis=1) for one in (along, angle, force)], axis=-1)
    velocity = np.zeros((contacts, samples, 6))
    velocity[..., 0] = -rate[..., 0]  # a slide moves the contact the other way
    velocity[..., 2] = -0.002 * rate[..., 2]
    velocity[..., 3] = rate[..., 1]
    velocity[..., 1] = -0.002 * rate[..., 1]
    velocity += rng.normal(size=velocity.shape) * [1e-4] * 6
    signals = counts(along.ravel(), angle.ravel(), force.ravel(), electrodes)
    signals += rng.normal(size=signals.shape)
    contact = np.repeat(np.arange(contacts), samples)
    split = np.select([contact % 10 == 6, contact % 10 == 7], [VALIDATION, TEST], TRAIN)
    count = len(contact)
    return TouchDataset(
        signals=signals.astype(np.float32),
        pressure=-signals.mean(axis=1).astype(np.float32),
        contact_point=skin(along.ravel(), angle.ravel()).astype(np.float32),
        velocity=velocity.reshape(-1, 6).astype(np.float32),
        orientation=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        contact=contact,
        pressed=np.full(count, True),
        trial=contact,
        time=np.tile(np.arange(samples) / RATE_HZ, contacts).astype(np.float32),
        motion=np.full(count, OTHER),
        split=split,
        rate_hz=np.array(RATE_HZ),
    )


def toy_geodesics(dataset: TouchDataset, bins: int = 4, size: int = 300, seed: int = 0) -> Geodesics:
    """Exact distances: the half cylinder unrolls into a plane."""
    chosen = np.random.default_rng(seed).permutation(len(dataset))[: bins * size].reshape(bins, size)
    points = dataset.contact_point[chosen]
    plane = np.stack([points[..., 0], RADIUS * np.arctan2(points[..., 1], -points[..., 2])], axis=-1)
    distance = np.linalg.norm(plane[:, :, None] - plane[:, None], axis=-1)
    return Geodesics(chosen, distance.astype(np.float32))


def doubled(dynamics):
    """The same models in double precision, as finite differences need."""
    arrays = {name: values.double() for name, values in dynamics.network.to_arrays().items()}
    return type(dynamics)(type(dynamics.network).from_arrays(arrays))
