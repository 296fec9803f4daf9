"""Latent spaces alone, without dynamics: what a set of touches says about a skin, and another set after it.

The autoencoders, their losses and errors are those of `learning` and `latent_evaluation`. Every set is seen
in its own units: signals and pressure standardised, distances over their root mean square. So a network that
learned from one set can be asked about another one, whose counts have other scales.
"""

import numpy as np

from structlearn.networks.torch_settings import as_tensor, one_thread, seeded
from structlearn.tactile.geodesics import Geodesics
from structlearn.tactile.latent_evaluation import SplitData
from structlearn.tactile.latent_models import LatentModels
from structlearn.tactile.latent_parameters import LatentSpaceParameters
from structlearn.tactile.latent_training import CHAIN_STEPS, Pairs, draw_pairs, train, training_data
from structlearn.tactile.touch_dataset import TRAIN, Chains, TouchDataset, TouchSamples, chains
from structlearn.tactile.units import TouchUnits, touch_units


def own_units(samples: TouchDataset, geodesics: Geodesics) -> TouchUnits:
    """Units of a set by its training samples; that of length is the root mean square distance on the skin.

    Raises:
        InputError: there is no training sample, or an electrode, the pressure or the velocity never changes.
    """
    length = float(np.sqrt(np.mean(np.square(geodesics.distance, dtype=float))))
    return touch_units(samples, chains(samples, CHAIN_STEPS, split=TRAIN), length)


def learn_spaces(
    samples: TouchDataset, geodesics: Geodesics, units: TouchUnits, parameters: LatentSpaceParameters
) -> LatentModels:
    """Train autoencoders of all seeds, with and without structure, on the training samples of a set.

    Returns the stack; its dynamics are as they were drawn.

    Raises:
        InputError: a bin has fewer than two training samples.
    """
    rng = np.random.default_rng(parameters.training.seed)
    pairs = draw_pairs(samples, geodesics, TRAIN, parameters.pair_pool, rng)
    return learn_from(samples, pairs, NO_CHAINS, units, parameters)


def learn_from(
    samples: TouchSamples, pairs: Pairs, taught: Chains, units: TouchUnits, parameters: LatentSpaceParameters
) -> LatentModels:
    """Train models of all seeds, with and without structure, on pairs whose distances are known.

    `pairs`: of training samples; `taught`: chains of training samples; without any, dynamics stay as they
    were drawn.
    """
    training = parameters.training
    data = training_data(samples, pairs, taught, units)
    models = LatentModels.initial(
        range(parameters.seeds),
        samples.signals.shape[1],
        parameters.networks,
        seeded(training.seed),
        actions=taught.actions.shape[-1],
    )
    with one_thread():
        for _ in train(models, data, training):
            pass  # only the end counts
    return models.detached()


def seen_in(
    units: TouchUnits, samples: TouchDataset, geodesics: Geodesics, split: int, pairs: int
) -> SplitData:
    """Samples and random pairs of one split, to test latent spaces on (`latent_evaluation.latent_errors`).

    `split`: which samples.

    Raises:
        InputError: a bin has fewer than two samples of the split.
    """
    found = draw_pairs(samples, geodesics, split, pairs, np.random.default_rng(split))
    return asked_of(units, samples, found, split)


def asked_of(units: TouchUnits, samples: TouchSamples, found: Pairs, split: int) -> SplitData:
    """Samples and given pairs of one split, in the networks' units."""
    rows = samples.split == split
    signals = units.signals(samples.signals)
    return SplitData(
        signals=as_tensor(signals[rows]),
        pressure=as_tensor(units.pressure(samples.pressure[rows])),
        first=as_tensor(signals[found.first]),
        second=as_tensor(signals[found.second]),
        geodesic=as_tensor(found.distance / units.length),
    )


NO_CHAINS = Chains(np.empty((0, CHAIN_STEPS + 1), dtype=int), np.empty((0, CHAIN_STEPS, 6)), np.empty(0))
"""Dynamics are not trained."""
