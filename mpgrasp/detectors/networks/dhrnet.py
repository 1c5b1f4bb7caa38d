"""DHRNet: a grasp network that keeps high resolution throughout and exchanges features between resolutions.

The paper's Section III-B: a convolutional stem, four stages with one to four parallel branches of residual
blocks, fuse layers between them (3x3 stride-2 convolutions down, bilinear up), and heads that see all
branches (Fig. 9b) or, for the paper's ablation, some of them. The layout of branches and fuse layers is
HRNet's (Wang et al., https://arxiv.org/abs/1908.07919), as in the authors' own code:
`DHRNetConfig(**AUTHORS)` has its 65.8 M parameters.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from mpgrasp.detectors.networks.declaration import MAX_CHANNELS, MAX_REPEATS, NetworkDeclaration
from mpgrasp.detectors.networks.grasp_network import BN_MOMENTUM, GraspNetwork, conv_bn, resize
from mpgrasp.exceptions import ConfigError

HEAD_BRANCHES = {"all": slice(None), "lower": slice(1, None), "highest": slice(1)}
"""Branches that the heads see: all (Fig. 9b), all but the finest (Fig. 9a), the finest alone."""
EXPANSION = 4
"""Output channels of a bottleneck block, in units of its width."""
AUTHORS: dict[str, Any] = {
    "width": 48,
    "modules": (1, 4, 3),
    "blocks": 4,
    "stem_width": 64,
    "stem_blocks": 4,
    "bottleneck": True,
    "head_width": 720,
    "fine_head": False,
}
"""Settings of the authors' own code."""


@dataclass(frozen=True, kw_only=True)
class DHRNetConfig:
    """Size of a DHRNet; the defaults are the one whose weights are shipped."""

    channels: int = 1
    """Input channels."""
    width: int = 24
    """Channels of the finest branch; each coarser one has twice as many."""
    modules: tuple[int, ...] = (1, 1, 1)
    """Modules (parallel residual blocks, then a fuse layer) in the stages of 2, 3 and 4 branches."""
    blocks: int = 2
    """Residual blocks per branch and module."""
    stem_width: int = 24
    """Channels of the stem and of the first stage."""
    stem_blocks: int = 1
    """Residual blocks of the first stage."""
    bottleneck: bool = False
    """First stage of bottleneck blocks, four times as wide at their ends, instead of residual ones."""
    head_width: int = 24
    """Channels into which the heads take all branches together."""
    head: str = "all"
    """Branches that the heads see, a key of `HEAD_BRANCHES`. "all" is the paper's; the others are its fusion
    ablation, to be compared with "all" without a fine head."""
    fine_head: bool = True
    """Heads at half of the input's resolution, with the stem's features of that resolution beside those of
    the branches, which begin at a quarter: thin objects are few pixels wide. Only with all branches: it would
    bring back the high resolution that "lower" leaves out."""

    def __post_init__(self) -> None:
        # JSON knows no tuples
        object.__setattr__(self, "modules", tuple(self.modules))
        sizes = (self.channels, self.width, self.stem_width, self.head_width)
        repeats = (self.blocks, self.stem_blocks, *self.modules)
        few = min(*sizes, *repeats) < 1
        if len(self.modules) != 3 or few or max(sizes) > MAX_CHANNELS or max(repeats) > MAX_REPEATS:
            raise ConfigError(
                "unusable DHRNet settings",
                got=self,
                allowed=f"1 to {MAX_CHANNELS} channels, 1 to {MAX_REPEATS} blocks, three counts of modules",
            )
        if self.head not in HEAD_BRANCHES:
            raise ConfigError("unknown head of a DHRNet", got=self.head, allowed=HEAD_BRANCHES)
        if self.fine_head and self.head != "all":
            raise ConfigError(
                "a fine head beside a head that leaves branches out", got=self.head, allowed="fine_head=False"
            )


class DHRNet(GraspNetwork):
    """(n, channels, H, W) -> pos, cos, sin and width, each (n, 1, H, W); H and W are multiples of 32."""

    def __init__(self, config: DHRNetConfig | None = None) -> None:
        super().__init__()
        self.config = c = config or DHRNetConfig()
        self.stem_half = conv_bn(c.channels, c.stem_width, 3, stride=2)
        self.stem_quarter = conv_bn(c.stem_width, c.stem_width, 3, stride=2)
        block = _Bottleneck if c.bottleneck else _Residual
        first = c.stem_width * (EXPANSION if c.bottleneck else 1)
        self.stage1 = nn.Sequential(
            *(block(c.stem_width if k == 0 else first, c.stem_width) for k in range(c.stem_blocks))
        )
        self.transitions, self.stages = nn.ModuleList(), nn.ModuleList()
        before = [first]
        for branches, modules in enumerate(c.modules, start=2):
            widths = [c.width * 2**k for k in range(branches)]
            self.transitions.append(_Transition(before, widths))
            # the last fuse layer makes no branch that the heads do not see
            seen = HEAD_BRANCHES[c.head] if branches == len(c.modules) + 1 else slice(None)
            fused = [slice(None)] * (modules - 1) + [seen]
            self.stages.append(nn.Sequential(*(_Module(widths, c.blocks, f) for f in fused)))
            before = widths
        self.head = _Mixed(before[HEAD_BRANCHES[c.head]], c.head_width)
        self.fine = conv_bn(c.head_width + c.stem_width, c.head_width, 3) if c.fine_head else None
        self.add_heads(c.head_width)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        half = self.stem_half(x)  # (n, stem_width, H/2, W/2)
        branches = [self.stage1(self.stem_quarter(half))]
        for transition, stage in zip(self.transitions, self.stages, strict=True):
            branches = stage(transition(branches))
        features: Tensor = self.head(branches)  # (n, head_width, H/4, W/4); H/8, W/8 of "lower"
        if self.fine is not None:
            features = self.fine(torch.cat([resize(features, half), half], dim=1))
        return self.maps(features, x)


class _Residual(nn.Module):
    def __init__(self, inputs: int, width: int) -> None:
        super().__init__()
        self.body = nn.Sequential(
            *conv_bn(inputs, width, 3),
            *conv_bn(width, width, 3, relu=False),
        )

    def forward(self, x: Tensor) -> Tensor:
        return F.relu(self.body(x).add_(x), inplace=True)


class _Bottleneck(nn.Module):
    def __init__(self, inputs: int, width: int) -> None:
        super().__init__()
        outputs = width * EXPANSION
        self.body = nn.Sequential(
            *conv_bn(inputs, width, 1),
            *conv_bn(width, width, 3),
            *conv_bn(width, outputs, 1, relu=False),
        )
        self.skip = nn.Identity() if inputs == outputs else conv_bn(inputs, outputs, 1, relu=False)

    def forward(self, x: Tensor) -> Tensor:
        return F.relu(self.body(x) + self.skip(x), inplace=True)


class _Transition(nn.Module):
    """Branches of the last stage -> branches of the next, which has one coarser branch more."""

    def __init__(self, before: list[int], widths: list[int]) -> None:
        super().__init__()
        self.same = nn.ModuleList(
            nn.Identity() if a == b else conv_bn(a, b, 3) for a, b in zip(before, widths, strict=False)
        )
        self.coarser = conv_bn(before[-1], widths[-1], 3, stride=2)

    def forward(self, x: list[Tensor]) -> list[Tensor]:
        return [*(f(b) for f, b in zip(self.same, x, strict=True)), self.coarser(x[-1])]


class _Module(nn.Module):
    """Parallel branches of residual blocks, then a fuse layer: each sums what it makes of all others.

    `fused` says which of the branches come out.
    """

    def __init__(self, widths: list[int], blocks: int, fused: slice) -> None:
        super().__init__()
        self.branches = nn.ModuleList(
            nn.Sequential(*(_Residual(w, w) for _ in range(blocks))) for w in widths
        )
        self.targets = range(len(widths))[fused]
        self.fuse = nn.ModuleList(
            nn.ModuleList(_fuse(widths, source, target) for source in range(len(widths)))
            for target in self.targets
        )

    def forward(self, x: list[Tensor]) -> list[Tensor]:
        x = [branch(b) for branch, b in zip(self.branches, x, strict=True)]
        fused = []
        for target, sources in zip(self.targets, self.fuse, strict=True):
            assert isinstance(sources, nn.ModuleList)
            total = x[target]
            for source, f in enumerate(sources):
                if source != target:
                    y = f(x[source])
                    total = total + (resize(y, x[target]) if source > target else y)
            fused.append(F.relu(total, inplace=True))
        return fused


def _fuse(widths: list[int], source: int, target: int) -> nn.Module:
    if source == target:
        return nn.Identity()
    if source > target:  # coarse to fine: fewer channels here, bilinear up in the forward pass
        return conv_bn(widths[source], widths[target], 1, relu=False)
    steps = [conv_bn(widths[source], widths[source], 3, stride=2) for _ in range(target - source - 1)]
    return nn.Sequential(*steps, conv_bn(widths[source], widths[target], 3, stride=2, relu=False))


class _Mixed(nn.Module):
    """Fig. 9: branches brought to the finest one's size, concatenated, and mixed by a 1x1 convolution.

    The mixing runs before the resizing, branch by branch, and is summed afterwards: the same linear map at a
    fraction of the cost.
    """

    def __init__(self, widths: list[int], outputs: int) -> None:
        super().__init__()
        self.mix = nn.ModuleList(nn.Conv2d(w, outputs, 1, bias=False) for w in widths)
        self.norm = nn.BatchNorm2d(outputs, momentum=BN_MOMENTUM)

    def forward(self, x: list[Tensor]) -> Tensor:
        total = self.mix[0](x[0])
        for f, b in zip(list(self.mix)[1:], x[1:], strict=True):
            total = total + resize(f(b), x[0])
        return F.relu(self.norm(total), inplace=True)


DECLARATIONS = {
    "dhrnet": NetworkDeclaration(
        network=DHRNet,
        config=DHRNetConfig,
        source="the paper; branches as in [HRNet](https://arxiv.org/abs/1908.07919)",
        variants={
            "shipped": {},
            "authors": AUTHORS,
            "all branches (Fig. 9b)": {"head": "all", "fine_head": False},
            "lower branches (Fig. 9a)": {"head": "lower", "fine_head": False},
            "highest branch": {"head": "highest", "fine_head": False},
        },
    ),
}
