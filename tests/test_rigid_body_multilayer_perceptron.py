import torch

from structlearn.networks.torch_settings import seeded
from structlearn.rigid_body.network_models import StackedPerceptrons


def test_states_of_a_standardised_network_are_seen_and_torques_given_in_units_of_the_data():
    plain = StackedPerceptrons.initial(2, (4,), [seeded(0)])
    states = list(torch.randn(3, 2, 50, generator=seeded(1)) * 3.0 + 2.0)
    torque = torch.randn(2, 50, generator=seeded(2)) * torch.tensor([[100.0], [0.0]]) + 5.0
    stack = plain.standardised(states, torque)
    mean, scale = torque.mean(dim=1, keepdim=True), stack.output_scale[:, None]
    seen = [
        (values - values.mean(dim=1, keepdim=True)) / values.std(dim=1, correction=0, keepdim=True)
        for values in states
    ]
    torch.testing.assert_close(stack.torques(*states), plain.torques(*seen) * scale + mean)
    torch.testing.assert_close(scale[0, 0], torque[0].std(correction=0))
    assert scale[1] == 1.0  # a constant torque
