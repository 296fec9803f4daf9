"""Hold our action-chunking transformer against LeRobot's: the same weights give the same outputs.

    pip download --no-deps lerobot==0.4.4 && unzip lerobot-*.whl lerobot/policies/act/modeling_act.py
    python benchmarks/act_of_lerobot.py lerobot/policies/act/modeling_act.py

Its network alone is loaded; what else it imports (images, storage) is replaced by empty modules.
"""

import importlib.util
import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import torch

from dissertation.rivals import networks
from dissertation.rivals.policies import Ensemble

STATE, TOUCH, ACTIONS = "observation.state", "observation.environment_state", "action"
EMPTY: dict[str, dict[str, Any]] = {
    "einops": {"repeat": lambda values, _, b: values[None].expand(b, -1, -1)},
    "torchvision": {},
    "torchvision.models._utils": {"IntermediateLayerGetter": None},
    "torchvision.ops.misc": {"FrozenBatchNorm2d": None},
    "lerobot.policies.act.configuration_act": {"ACTConfig": object},
    "lerobot.policies.pretrained": {"PreTrainedPolicy": object},
    "lerobot.utils.constants": {
        "ACTION": ACTIONS,
        "OBS_ENV_STATE": TOUCH,
        "OBS_IMAGES": "observation.images",
        "OBS_STATE": STATE,
    },
}


def main() -> None:
    """Print the largest differences: acting, training, divergence of the style, and temporal ensembling."""
    for name, content in EMPTY.items():
        for parent in (name.rsplit(".", depth)[0] for depth in range(name.count("."), 0, -1)):
            sys.modules.setdefault(parent, ModuleType(parent))
        sys.modules[name] = ModuleType(name)
        vars(sys.modules[name]).update(content)
    spec = importlib.util.spec_from_file_location("modeling_act", sys.argv[1])
    assert spec is not None
    assert spec.loader is not None
    lerobot = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(lerobot)
    sizes, width, layers, chunk = (10, 38), 64, 2, 16
    features = dict(
        zip(("robot_state_feature", "env_state_feature", "action_feature"), (*sizes, 6), strict=True)
    )
    theirs = lerobot.ACT(
        SimpleNamespace(
            **{name: SimpleNamespace(shape=(size,)) for name, size in features.items()},
            image_features={},
            use_vae=True,
            dim_model=width,
            n_heads=networks.HEADS,
            dim_feedforward=networks.WIDER * width,
            feedforward_activation="relu",
            n_encoder_layers=layers,
            n_vae_encoder_layers=layers,
            n_decoder_layers=1,
            latent_dim=networks.LATENT,
            chunk_size=chunk,
            dropout=0.0,
            pre_norm=False,
        )
    )
    networks.DROPOUT = 0.0
    ours = networks.ActionChunking(sizes, 6, width, layers, chunk)
    layers_of = {".layers.": ".", "decoder.0.": "decoder.", "decoder.norm.": "decoder_norm."}
    weights = theirs.state_dict()
    for place, name in layers_of.items():
        weights = {one.replace(place, name): values for one, values in weights.items()}
    ours.load_state_dict(weights)
    state, touch, actions = torch.randn(5, 10), torch.randn(5, 38), torch.randn(5, chunk, 6)
    batch = {
        STATE: state,
        TOUCH: touch,
        ACTIONS: actions,
        "action_is_pad": torch.zeros(5, chunk, dtype=torch.bool),
    }
    with torch.no_grad():
        print(f"acting: {(theirs.eval()(batch)[0] - ours.eval()(state, touch)[0]).abs().max():.1e}")
        torch.manual_seed(1)
        expected, (mean, log_variance) = theirs.train()(batch)
        torch.manual_seed(1)
        found, divergence = ours.train()(state, touch, actions)
    kl = (-0.5 * (1 + log_variance - mean.square() - log_variance.exp())).sum(-1).mean()
    print(f"training: {(found - expected).abs().max():.1e}, divergence {(divergence - kl).abs():.1e}")
    ensembles = lerobot.ACTTemporalEnsembler(0.01, chunk), Ensemble(0.01)
    largest = 0.0
    for actions in np.random.default_rng(0).standard_normal((60, chunk, 6)):
        one = ensembles[0].update(torch.tensor(actions)[None]).numpy()[0]
        largest = max(largest, np.abs(one - ensembles[1].update(actions)).max())
    print(f"temporal ensembling: {largest:.1e}")


if __name__ == "__main__":
    main()
