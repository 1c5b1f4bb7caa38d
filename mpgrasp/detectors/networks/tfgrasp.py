"""TF-Grasp: a grasp network of Swin transformer blocks, encoder and decoder, with skip connections.

Wang, Zhou and Kan: When Transformer Meets Robotic Grasping (RA-L 2022, https://arxiv.org/abs/2202.11911); the
blocks are Swin's (Liu et al., https://arxiv.org/abs/2103.14030), the decoder's expansion is Swin-Unet's (Cao
et al., https://arxiv.org/abs/2105.05537). The defaults are the settings of the authors' code
(https://github.com/WangShaoSUN/grasp-transformer, main.py and models/swin.py): patches of 4 px, 48 channels,
two blocks a stage, windows of 7, skip connections that concatenate a stage's input and reduce the two
linearly, heads without bias at full resolution. Two departures: where a token is expanded to 2x2 or 4x4, its
parts go to where the token was, as in Swin-Unet, while the authors' code reshapes without interleaving, which
moves them elsewhere in the image; and perceptrons have GELU as Swin's, not ReLU. State dicts of the authors'
code are computed as that code does.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from mpgrasp.depth import NETWORK_SIZE
from mpgrasp.detectors.networks.declaration import HEADS, MAX_CHANNELS, MAX_REPEATS, NetworkDeclaration
from mpgrasp.detectors.networks.tfgrasp_published import PUBLISHED
from mpgrasp.exceptions import ConfigError

Activation = Literal["gelu", "relu"]

PATCH = 4
"""Side of the patches that become tokens [px]."""
MASKED = -1e4
"""Added to scores of tokens that must not see each other; their softmax is zero, not a slow denormal."""
BIAS_STD = 0.02
"""Spread of first position biases."""
HEAD_STD = 0.02
"""Spread of the heads' first weights."""


@dataclass(frozen=True, kw_only=True)
class TFGraspConfig:
    """Size of a TF-Grasp; the defaults are the authors'."""

    channels: int = 1
    """Input channels."""
    size: int = NETWORK_SIZE
    """Side of the input image [px]: stages and their windows are laid out for it."""
    embed: int = 48
    """Channels of the finest stage; each coarser one has twice as many."""
    depths: tuple[int, ...] = (2, 2, 2, 2)
    """Blocks of the stages, finest first; the decoder has as many at each resolution."""
    heads: tuple[int, ...] = (1, 2, 4, 8)
    """Attention heads of the stages."""
    window: int = 7
    """Side of the windows within which tokens attend to each other [tokens]."""
    mlp_ratio: int = 4
    """Hidden channels of the perceptrons, in units of the stage's."""
    drop_path: float = 0.1
    """Probability that training skips the last block; it rises linearly from 0 at the first."""
    activation: Activation = "gelu"
    """Of the perceptrons."""
    interleaved: bool = True
    """True if the parts of an expanded token go to where it was; False as in the authors' code."""

    def __post_init__(self) -> None:
        # JSON knows no tuples
        object.__setattr__(self, "depths", tuple(self.depths))
        object.__setattr__(self, "heads", tuple(self.heads))
        repeats = (self.window, self.mlp_ratio, len(self.depths), *self.depths)
        sizes = (self.channels, self.size, self.embed, *self.heads, *repeats)
        many = max(sizes) > MAX_CHANNELS or max(repeats) > MAX_REPEATS
        if many or min(sizes) < 1 or len(self.depths) != len(self.heads) or not 0 <= self.drop_path < 1:
            raise ConfigError(
                "unusable TF-Grasp settings",
                got=self,
                allowed=f"sizes of 1 to {MAX_CHANNELS}, window, mlp_ratio, depths and their number of 1 to"
                f" {MAX_REPEATS}, as many depths as heads, drop_path from 0 to below 1",
            )
        if self.activation not in get_args(Activation):
            raise ConfigError("unknown activation", got=self.activation, allowed=get_args(Activation))
        if any(self.embed * 2**k % h for k, h in enumerate(self.heads)):
            raise ConfigError("attention heads that do not share out the channels", got=self.heads)
        unit = PATCH * self.window * 2 ** (len(self.depths) - 1)
        if self.size % unit:
            raise ConfigError(
                "an image that windows do not tile", got=self.size, allowed=f"multiples of {unit}"
            )


class TFGrasp(nn.Module):
    """(n, channels, size, size) -> pos, cos, sin and width, each (n, 1, size, size)."""

    def __init__(self, config: TFGraspConfig | None = None) -> None:
        super().__init__()
        self.config = c = config or TFGraspConfig()
        stages = range(len(c.depths))
        widths = [c.embed * 2**k for k in stages]
        rates = torch.split(torch.linspace(0, c.drop_path, sum(c.depths), device="cpu"), list(c.depths))
        self.patches = nn.Conv2d(c.channels, c.embed, PATCH, stride=PATCH)
        self.patch_norm = nn.LayerNorm(c.embed)
        self.encoder = nn.ModuleList(_Stage(c, k, rates[k].tolist()) for k in stages)
        self.merge = nn.ModuleList(_Merge(width) for width in widths[:-1])
        self.norm = nn.LayerNorm(widths[-1])
        # decoder, finest stage first
        together = c.interleaved
        self.expand = nn.ModuleList(_Expand(width, 2, width // 2, together) for width in widths[1:])
        self.reduce = nn.ModuleList(nn.Linear(2 * width, width) for width in widths[:-1])
        self.decoder = nn.ModuleList(_Stage(c, k, rates[k].tolist()) for k in stages[:-1])
        self.decoder_norm = nn.LayerNorm(c.embed)
        self.pixels = _Expand(c.embed, PATCH, c.embed, together)
        for module in self.modules():
            if isinstance(module, nn.Linear):
                # layers of 48 to 384 channels need more than the 0.02 of large ones, or all tokens stay alike
                nn.init.xavier_uniform_(module.weight)
                if module.bias is not None:
                    nn.init.zeros_(module.bias)
        for name in HEADS:
            head = nn.Conv2d(c.embed, 1, 1, bias=False)
            # pixels leave the last norm at unit size: larger heads fill the background with noise, and for
            # hundreds of steps all gradients are spent on silencing it
            nn.init.normal_(head.weight, std=HEAD_STD)
            self.add_module(f"{name}_output", head)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        # tokens stay in single precision under autocast: what blocks add is small beside what is there
        tokens = self.patch_norm(self.patches(x).permute(0, 2, 3, 1).float())  # (n, size/4, size/4, embed)
        skips: list[Tensor] = []
        for stage, merge in zip(self.encoder, self.merge, strict=False):
            skips.append(tokens)
            tokens = merge(stage(tokens)).float()
        tokens = self.norm(self.encoder[-1](tokens))
        for k in reversed(range(len(skips))):
            tokens = self.reduce[k](torch.cat([self.expand[k](tokens), skips[k]], dim=-1)).float()
            tokens = self.decoder[k](tokens)
        pixels = self.pixels.parts(self.decoder_norm(tokens))  # (n, size/4, size/4, 4, 4, embed)
        # the four 1x1 convolutions as one, before the pixels are put in their places: four channels to move
        weights = torch.cat([getattr(self, f"{name}_output").weight for name in HEADS]).flatten(1)
        maps = self.pixels.placed(F.linear(pixels, weights).float()).permute(0, 3, 1, 2)
        pos, cos, sin, width = torch.split(maps, 1, dim=1)
        return pos, cos, sin, width


class _Stage(nn.Sequential):
    """Blocks at one resolution; every other one has its windows shifted by half a window."""

    def __init__(self, config: TFGraspConfig, stage: int, rates: list[float]) -> None:
        side = config.size // PATCH // 2**stage
        # one window that covers everything has nowhere to shift to
        shift = config.window // 2 if side > config.window else 0
        super().__init__(
            *(_Block(config, stage, side, shift * (k % 2), rate) for k, rate in enumerate(rates))
        )


class _Block(nn.Module):
    """Attention within windows and a perceptron, each added to what came in."""

    def __init__(self, config: TFGraspConfig, stage: int, side: int, shift: int, drop_path: float) -> None:
        super().__init__()
        width = config.embed * 2**stage
        self.side, self.window, self.shift = side, config.window, shift
        self.drop_path = drop_path
        self.norm1, self.norm2 = nn.LayerNorm(width), nn.LayerNorm(width)
        self.attention = _Attention(width, config.heads[stage], config.window)
        self.mlp = nn.Sequential(
            nn.Linear(width, width * config.mlp_ratio),
            nn.GELU() if config.activation == "gelu" else nn.ReLU(),
            nn.Linear(width * config.mlp_ratio, width),
        )
        mask = _shift_mask(side, config.window, shift) if shift else None
        self.register_buffer("mask", mask, persistent=False)
        self.mask: Tensor | None

    def forward(self, x: Tensor) -> Tensor:
        x = x + self._kept(self._windowed(self.norm1(x)))
        y: Tensor = x + self._kept(self.mlp(self.norm2(x)))
        return y

    def _windowed(self, x: Tensor) -> Tensor:
        """Attend in windows over (n, side, side, width), rolled by the shift and back."""
        n, width, w, across = x.shape[0], x.shape[-1], self.window, self.side // self.window
        if self.shift:
            x = x.roll((-self.shift, -self.shift), dims=(1, 2))
        x = x.reshape(n, across, w, across, w, width).transpose(2, 3).reshape(-1, w * w, width)
        x = self.attention(x, self.mask)
        x = x.reshape(n, across, across, w, w, width).transpose(2, 3).reshape(n, self.side, self.side, width)
        return x.roll((self.shift, self.shift), dims=(1, 2)) if self.shift else x

    def _kept(self, x: Tensor) -> Tensor:
        """Stochastic depth: in training, some images go without this branch."""
        if not self.training or self.drop_path == 0:
            return x
        kept = x.new_empty(x.shape[0], 1, 1, 1).bernoulli_(1 - self.drop_path)
        return x * kept / (1 - self.drop_path)


class _Attention(nn.Module):
    """Multi-head attention among the tokens of a window, with a learned bias for each relative position."""

    def __init__(self, width: int, heads: int, window: int) -> None:
        super().__init__()
        self.heads = heads
        self.qkv = nn.Linear(width, 3 * width)
        self.out = nn.Linear(width, width)
        self.bias = nn.Parameter(torch.empty(heads, (2 * window - 1) ** 2))
        nn.init.trunc_normal_(self.bias, std=BIAS_STD)
        self.register_buffer("offsets", _offsets(window), persistent=False)
        self.offsets: Tensor

    def forward(self, x: Tensor, mask: Tensor | None) -> Tensor:
        """Attend in windows: x (n * windows, tokens, width), mask (windows, 1, tokens, tokens) or None."""
        tokens, width = x.shape[1:]
        qkv = self.qkv(x).reshape(-1, tokens, 3, self.heads, width // self.heads)
        q, k, v = qkv.permute(2, 0, 3, 1, 4).unbind(0)  # each (n * windows, heads, tokens, width / heads)
        # written out: for windows this small it is up to twice as fast on the CPU as the fused attention
        scores = (q * (width // self.heads) ** -0.5) @ k.transpose(-1, -2)
        bias = self.bias[:, self.offsets].to(scores.dtype)  # (heads, tokens, tokens)
        if mask is None:
            scores = scores + bias
        else:
            bias = bias + mask.to(scores.dtype)  # (windows, heads, tokens, tokens), the same for every image
            scores = (scores.reshape(-1, *bias.shape) + bias).reshape(scores.shape)
        y = scores.softmax(-1).to(v.dtype) @ v
        out: Tensor = self.out(y.transpose(1, 2).reshape(x.shape))
        return out


def _offsets(window: int) -> Tensor:
    """Return the index of the relative position of each pair of a window's tokens, (tokens, tokens)."""
    row, col = (a.flatten() for a in torch.meshgrid(*[torch.arange(window)] * 2, indexing="ij"))
    down, right = (a[:, None] - a[None, :] + window - 1 for a in (row, col))
    return down * (2 * window - 1) + right


def _shift_mask(side: int, window: int, shift: int) -> Tensor:
    """0 for tokens of a shifted window that are neighbours in the image, `MASKED` where the roll joined them.

    (windows, 1, tokens, tokens)
    """
    band = torch.zeros(side, dtype=torch.long)
    band[-window:-shift], band[-shift:] = 1, 2
    region = 3 * band[:, None] + band[None, :]
    across = side // window
    tiles = region.reshape(across, window, across, window).transpose(1, 2).reshape(across**2, window**2)
    return torch.where(tiles[:, :, None] == tiles[:, None, :], 0.0, MASKED)[:, None]


class _Merge(nn.Module):
    """2x2 tokens into one of twice the width."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(4 * width)
        self.reduce = nn.Linear(4 * width, 2 * width, bias=False)

    def forward(self, x: Tensor) -> Tensor:
        n, side, _, width = x.shape
        x = x.reshape(n, side // 2, 2, side // 2, 2, width).transpose(2, 3)
        y: Tensor = self.reduce(self.norm(x.reshape(n, side // 2, side // 2, 4 * width)))
        return y


class _Expand(nn.Module):
    """A token into factor x factor tokens of width `outputs`, where it was if they stay together."""

    def __init__(self, width: int, factor: int, outputs: int, together: bool) -> None:
        super().__init__()
        self.factor, self.together = factor, together
        self.expand = nn.Linear(width, outputs * factor**2, bias=False)
        self.norm = nn.LayerNorm(outputs)

    def parts(self, x: Tensor) -> Tensor:
        """Expand tokens (n, H, W, width) to (n, H, W, factor, factor, outputs)."""
        n, height, across, _ = x.shape
        y: Tensor = self.norm(self.expand(x).reshape(n, height, across, self.factor, self.factor, -1))
        return y

    def placed(self, parts: Tensor) -> Tensor:
        """Put parts (n, H, W, factor, factor, any) in their places (n, H * factor, W * factor, any)."""
        n, height, across = parts.shape[:3]
        if self.together:
            parts = parts.transpose(2, 3)
        return parts.reshape(n, height * self.factor, across * self.factor, -1)

    def forward(self, x: Tensor) -> Tensor:
        return self.placed(self.parts(x))


DECLARATIONS = {
    "tfgrasp": NetworkDeclaration(
        network=TFGrasp,
        config=TFGraspConfig,
        source="[TF-Grasp](https://arxiv.org/abs/2202.11911)",
        published=PUBLISHED,
    ),
}
