import numpy as np
import torch

from structlearn.tactile.latent_models import StackedAutoencoders, latent_losses


def test_losses_are_those_of_the_text():
    stack = StackedAutoencoders.initial(2, 6, (5, 4), torch.Generator().manual_seed(0))
    rng = np.random.default_rng(0)
    signals, pressure, geodesic = rng.normal(size=(2, 6, 8)), rng.normal(size=(2, 8)), rng.random((2, 4))
    losses = latent_losses(
        stack, *(torch.tensor(values, dtype=torch.float32) for values in (signals, pressure, geodesic))
    )
    inputs = torch.tensor(signals, dtype=torch.float32)
    latent = stack.encoder.forward(inputs, training=True).detach()
    decoded = stack.decoder.forward(latent, training=True).detach().numpy()
    latent = latent.numpy()
    apart = np.hypot(*np.moveaxis(latent[:, :2, :4] - latent[:, :2, 4:], 1, 0))
    errors = {"distances": apart - geodesic, "pressure": latent[:, 2] - pressure}
    for name, error in (errors | {"reconstruction": decoded - signals}).items():
        expected = np.square(error).reshape(2, -1).mean(axis=1)
        np.testing.assert_allclose(getattr(losses, name).detach(), expected, rtol=1e-4)


def test_two_samples_at_one_point_have_a_gradient():
    stack = StackedAutoencoders.initial(1, 6, (5,), torch.Generator().manual_seed(0))
    same = torch.randn(1, 6, 4).repeat(1, 1, 2)
    losses = latent_losses(stack, same, torch.zeros(1, 8), torch.ones(1, 4))
    found = torch.autograd.grad(losses.distances.sum(), stack.encoder.weights)
    assert all(gradient.isfinite().all() for gradient in found)
