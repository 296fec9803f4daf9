"""Networks that imitate poses: a feed-forward one, and an action-chunking transformer (ACT).

Both map the standardised state (pose and task) and touch, or what is seen, to a chunk of H later poses.

ACT is that of Zhao, Kumar, Levine & Finn (2023, "Learning fine-grained bimanual manipulation with low-cost
hardware"): a conditional variational auto-encoder. Its encoder compresses a demonstrated chunk to a style z;
its decoder is a transformer from tokens of z, state and touch to the chunk; z = 0 when it acts. LeRobot 0.4.4
implements it, also without images, but needs torch < 2.11 and rerun-sdk < 0.27, where we use 2.13 and 0.41.
This module is therefore our own; it gives the same outputs for LeRobot's weights
(`benchmarks/act_of_lerobot.py`), and is smaller (`DEPARTURES`): we have some dozens of demonstrations, and no
cameras.
"""

from itertools import pairwise

import numpy as np
import torch
from torch import Tensor, nn

HEADS, LATENT, DROPOUT, KL_WEIGHT = 4, 8, 0.1, 10.0
WIDER = 2  # width of the feed-forward part of a layer, relative to its tokens
DEPARTURES = {  # published (table III of the paper and its text), and here
    "dim_model": (512, "chosen"),
    "heads": (8, HEADS),
    "dim_feedforward / dim_model": (3200 / 512, WIDER),
    "encoder layers": (4, "chosen"),
    "decoder layers": (7, 1),  # the authors' code used the first alone; LeRobot has 1
    "latent_dim": (32, LATENT),
    "dropout": (0.1, DROPOUT),
    "kl_weight": (10.0, KL_WEIGHT),
    "chunk": (100, "chosen"),
    "rate_hz": (50, "chosen"),
    "learning_rate": (1e-5, "chosen"),
    "batch": (8, 32),
    "optimiser": ("AdamW", "Adam, rate falling to 0"),
    "gradient steps": ("hours on a GPU", "chosen"),
    "actions": ("commands of a leader arm", "measured poses"),
    "inputs": ("images and joint angles", "hand's pose, touch or sphere"),
    "padding": ("masked", "the hand rests"),  # of chunks beyond the end
}


class Feedforward(nn.Module):
    """Fully connected network with rectified hidden layers."""

    error = staticmethod(nn.functional.mse_loss)

    def __init__(self, inputs: tuple[int, int], action: int, width: int, layers: int, chunk: int) -> None:
        """`inputs`: sizes of state and touch; `action`: A, of a pose; `chunk`: H."""
        super().__init__()
        self.action = action
        sizes = [sum(inputs), *[width] * layers]
        hidden = [part for pair in pairwise(sizes) for part in (nn.Linear(*pair), nn.ReLU())]
        self.layers = nn.Sequential(*hidden, nn.Linear(sizes[-1], chunk * action))

    def forward(self, state: Tensor, touch: Tensor, _: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Chunks (B, H, A) from (B, S) and (B, E), and 0: there are no styles that could diverge."""
        return self.layers(torch.cat([state, touch], dim=-1)).unflatten(-1, (-1, self.action)), torch.zeros(
            ()
        )


class ActionChunking(nn.Module):
    """Action-chunking transformer; `layers` of both encoders, otherwise constructed as `Feedforward`."""

    vae_encoder_pos_enc: Tensor
    error = staticmethod(nn.functional.l1_loss)

    def __init__(self, inputs: tuple[int, int], action: int, width: int, layers: int, chunk: int) -> None:
        super().__init__()
        self.vae_encoder = nn.ModuleList(EncoderLayer(width) for _ in range(layers))
        self.vae_encoder_cls_embed = nn.Embedding(1, width)
        self.vae_encoder_robot_state_input_proj = nn.Linear(inputs[0], width)
        self.vae_encoder_action_input_proj = nn.Linear(action, width)
        self.vae_encoder_latent_output_proj = nn.Linear(width, 2 * LATENT)
        self.register_buffer("vae_encoder_pos_enc", sinusoids(2 + chunk, width)[None])
        self.encoder = nn.ModuleList(EncoderLayer(width) for _ in range(layers))
        self.encoder_1d_feature_pos_embed = nn.Embedding(3, width)
        self.encoder_latent_input_proj = nn.Linear(LATENT, width)
        self.encoder_robot_state_input_proj = nn.Linear(inputs[0], width)
        self.encoder_env_state_input_proj = nn.Linear(inputs[1], width)
        self.decoder, self.decoder_norm = DecoderLayer(width), nn.LayerNorm(width)
        self.decoder_pos_embed = nn.Embedding(chunk, width)
        self.action_head = nn.Linear(width, action)
        for weights in (*self.encoder.parameters(), *self.decoder.parameters()):
            if weights.dim() > 1:
                nn.init.xavier_uniform_(weights)

    def forward(self, state: Tensor, touch: Tensor, actions: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Chunks (B, H, A) from (B, S) and (B, E), and the mean divergence of their styles from the prior.

        `actions`: (B, H, A) demonstrated chunks, whose styles are drawn; None: the prior's mean style.
        """
        style, divergence = torch.zeros(len(state), LATENT), torch.zeros(())
        if actions is not None:
            style, divergence = self._style(state, actions)
        tokens = torch.stack(
            [
                self.encoder_latent_input_proj(style),
                self.encoder_robot_state_input_proj(state),
                self.encoder_env_state_input_proj(touch),
            ]
        )
        places, queries = (
            one.weight[:, None] for one in (self.encoder_1d_feature_pos_embed, self.decoder_pos_embed)
        )
        for layer in self.encoder:
            tokens = layer(tokens, places)
        chunk = self.decoder(torch.zeros(len(queries), *tokens.shape[1:]), queries, tokens, places)
        return self.action_head(self.decoder_norm(chunk).transpose(0, 1)), divergence

    def _style(self, state: Tensor, actions: Tensor) -> tuple[Tensor, Tensor]:
        first = self.vae_encoder_cls_embed.weight.expand(len(state), 1, -1)
        own = self.vae_encoder_robot_state_input_proj(state)[:, None]
        tokens = torch.cat([first, own, self.vae_encoder_action_input_proj(actions)], dim=1).transpose(0, 1)
        for layer in self.vae_encoder:
            tokens = layer(tokens, self.vae_encoder_pos_enc.transpose(0, 1))
        mean, log_variance = self.vae_encoder_latent_output_proj(tokens[0]).chunk(2, dim=1)
        style = mean + (0.5 * log_variance).exp() * torch.randn_like(mean)
        return style, -0.5 * (1.0 + log_variance - mean.square() - log_variance.exp()).sum(dim=1).mean()


class EncoderLayer(nn.Module):
    """Self-attention and a feed-forward part, each added and normalised after."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.self_attn = nn.MultiheadAttention(width, HEADS, dropout=DROPOUT)
        self.linear1, self.linear2 = nn.Linear(width, WIDER * width), nn.Linear(WIDER * width, width)
        self.norm1, self.norm2 = nn.LayerNorm(width), nn.LayerNorm(width)
        self.dropout = nn.Dropout(DROPOUT)

    def forward(self, x: Tensor, places: Tensor) -> Tensor:
        """Tokens (N, B, D) at places (N, 1, D), which only say where to look."""
        return self.norm2(self.widened(self.attended(x, places)))

    def attended(self, x: Tensor, places: Tensor) -> Tensor:
        """Normalised tokens after self-attention."""
        q = x + places
        return self.norm1(x + self.dropout(self.self_attn(q, q, x, need_weights=False)[0]))

    def widened(self, x: Tensor) -> Tensor:
        """Tokens after the feed-forward part."""
        return x + self.dropout(self.linear2(self.dropout(self.linear1(x).relu())))


class DecoderLayer(EncoderLayer):
    """Attends to the encoder's tokens, too, between both parts."""

    def __init__(self, width: int) -> None:
        super().__init__(width)
        self.multihead_attn = nn.MultiheadAttention(width, HEADS, dropout=DROPOUT)
        self.norm3 = nn.LayerNorm(width)

    def forward(self, x: Tensor, places: Tensor, *seen: Tensor) -> Tensor:
        """Queries (H, B, D); `seen`: the encoder's tokens (N, B, D) and their places (N, 1, D)."""
        x, (tokens, token_places) = self.attended(x, places), seen
        looked = self.multihead_attn(x + places, tokens + token_places, tokens, need_weights=False)[0]
        return self.norm3(self.widened(self.norm2(x + self.dropout(looked))))


def sinusoids(count: int, width: int) -> Tensor:
    """Fixed embeddings (count, width) of places in a sequence (Vaswani et al. 2017)."""
    columns = np.arange(width)
    angles = np.arange(count)[:, None] / np.power(10000.0, 2 * (columns // 2) / width)
    return torch.tensor(np.where(columns % 2, np.cos(angles), np.sin(angles)), dtype=torch.float32)
