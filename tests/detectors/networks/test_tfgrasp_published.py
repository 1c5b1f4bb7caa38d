"""TF-Grasp's published state dicts: our network computes of them what the authors' code computes.

The oracle below is written from the state dict's side: it knows their names and their order of things, and
nothing of our network.
"""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from torch import Tensor
from torch.nn import functional as F

from mpgrasp.detectors.networks.weights import load_weights
from mpgrasp.exceptions import WeightsError

EMBED, WINDOW, SIZE = 8, 7, 224
HEADS, DEPTHS = (1, 2, 4, 8), (2, 2, 2, 2)
State = dict[str, Tensor]


def published(channels: int = 1, seed: int = 0) -> State:
    """A state dict as the authors' code saves it, of random numbers."""
    random = torch.Generator().manual_seed(seed)

    def some(*shape: int) -> Tensor:
        return 0.3 * torch.randn(*shape, generator=random)

    state: State = {}

    def linear(name: str, inputs: int, outputs: int, *, bias: bool = True) -> None:
        state[f"{name}.weight"] = some(outputs, inputs) / inputs**0.5 * 3
        if bias:
            state[f"{name}.bias"] = some(outputs)

    def norm(name: str, width: int) -> None:
        state[f"{name}.weight"], state[f"{name}.bias"] = 1 + some(width), some(width)

    def blocks(name: str, stage: int) -> None:
        width = EMBED * 2**stage
        for k in range(DEPTHS[stage]):
            block = f"{name}.blocks.{k}"
            norm(f"{block}.norm1", width)
            state[f"{block}.attn.relative_position_bias_table"] = some((2 * WINDOW - 1) ** 2, HEADS[stage])
            state[f"{block}.attn.relative_position_index"] = _offsets()
            linear(f"{block}.attn.qkv", width, 3 * width)
            linear(f"{block}.attn.proj", width, width)
            norm(f"{block}.norm2", width)
            linear(f"{block}.mlp.fc1", width, 4 * width)
            linear(f"{block}.mlp.fc2", 4 * width, width)
            if k % 2 and SIZE // 4 // 2**stage > WINDOW:
                state[f"{block}.attn_mask"] = _mask(SIZE // 4 // 2**stage)

    state["patch_embed.proj.weight"], state["patch_embed.proj.bias"] = (
        some(EMBED, channels, 4, 4),
        some(EMBED),
    )
    norm("patch_embed.norm", EMBED)
    for stage in range(4):
        width = EMBED * 2**stage
        blocks(f"layers.{stage}", stage)
        if stage < 3:
            linear(f"layers.{stage}.downsample.reduction", 4 * width, 2 * width, bias=False)
            norm(f"layers.{stage}.downsample.norm", 4 * width)
    norm("norm", 8 * EMBED)
    linear("layers_up.0.expand", 8 * EMBED, 16 * EMBED, bias=False)
    norm("layers_up.0.norm", 4 * EMBED)
    for up in (1, 2, 3):
        stage, width = 3 - up, EMBED * 2 ** (3 - up)
        linear(f"concat_back_dim.{up}", 2 * width, width)
        blocks(f"layers_up.{up}", stage)
        if up < 3:
            linear(f"layers_up.{up}.upsample.expand", width, 2 * width, bias=False)
            norm(f"layers_up.{up}.upsample.norm", width // 2)
    norm("norm_up", EMBED)
    linear("up.expand", EMBED, 16 * EMBED, bias=False)
    norm("up.norm", EMBED)
    for head in ("pos", "cos", "sin", "width"):
        state[f"{head}_output.weight"] = some(1, EMBED, 1, 1)
    return state


def _offsets() -> Tensor:
    places = [(r, c) for r in range(WINDOW) for c in range(WINDOW)]
    rows = [
        [(a[0] - b[0] + WINDOW - 1) * (2 * WINDOW - 1) + a[1] - b[1] + WINDOW - 1 for b in places]
        for a in places
    ]
    return torch.tensor(rows)


def _windows(x: Tensor) -> Tensor:
    """Windows (k, 49, C) of tokens (H, W, C), row by row."""
    side = len(x)
    found = [
        x[r : r + WINDOW, c : c + WINDOW].reshape(WINDOW**2, -1)
        for r in range(0, side, WINDOW)
        for c in range(0, side, WINDOW)
    ]
    return torch.stack(found)


def _mask(side: int) -> Tensor:
    region = torch.zeros(side, side, 1)
    bounds = [(0, side - WINDOW), (side - WINDOW, side - WINDOW // 2), (side - WINDOW // 2, side)]
    for number, (rows, cols) in enumerate((a, b) for a in bounds for b in bounds):
        region[rows[0] : rows[1], cols[0] : cols[1]] = number
    windows = _windows(region).squeeze(-1)
    return torch.where(windows[:, :, None] == windows[:, None, :], 0.0, -100.0)


def _norm(state: State, name: str, x: Tensor) -> Tensor:
    return F.layer_norm(x, x.shape[-1:], state[f"{name}.weight"], state[f"{name}.bias"])


def _linear(state: State, name: str, x: Tensor) -> Tensor:
    return F.linear(x, state[f"{name}.weight"], state.get(f"{name}.bias"))


def _block(state: State, name: str, x: Tensor, heads: int, *, shifted: bool) -> Tensor:
    side, width = len(x), x.shape[-1]
    shift = WINDOW // 2 if shifted and side > WINDOW else 0
    windows = _windows(torch.roll(_norm(state, f"{name}.norm1", x), (-shift, -shift), (0, 1)))
    q, k, v = torch.split(_linear(state, f"{name}.attn.qkv", windows), width, dim=-1)
    parts = []
    for head in range(heads):
        of = slice(head * width // heads, (head + 1) * width // heads)
        scores = (q[..., of] * (width // heads) ** -0.5) @ k[..., of].transpose(1, 2)
        scores = scores + state[f"{name}.attn.relative_position_bias_table"][_offsets(), head]
        if shift:
            scores = scores + _mask(side)
        parts.append(scores.softmax(-1) @ v[..., of])
    windows = _linear(state, f"{name}.attn.proj", torch.cat(parts, dim=-1))
    attended = torch.empty_like(x)
    starts = [(r, c) for r in range(0, side, WINDOW) for c in range(0, side, WINDOW)]
    for (r, c), window in zip(starts, windows, strict=True):
        attended[r : r + WINDOW, c : c + WINDOW] = window.reshape(WINDOW, WINDOW, width)
    x = x + torch.roll(attended, (shift, shift), (0, 1))
    hidden = _linear(state, f"{name}.mlp.fc1", _norm(state, f"{name}.norm2", x)).relu()
    return x + _linear(state, f"{name}.mlp.fc2", hidden)


def _blocks(state: State, name: str, x: Tensor, stage: int) -> Tensor:
    for k in range(DEPTHS[stage]):
        x = _block(state, f"{name}.blocks.{k}", x, HEADS[stage], shifted=bool(k % 2))
    return x


def _expanded(state: State, name: str, x: Tensor, factor: int) -> Tensor:
    """The authors' reshape: not interleaved."""
    side = factor * len(x)
    return _norm(state, f"{name}.norm", _linear(state, f"{name}.expand", x).reshape(side, side, -1))


def computed(state: State, image: Tensor) -> Tensor:
    """Heads (4, H, W) of an image (channels, H, W)."""
    x = F.conv2d(image[None], state["patch_embed.proj.weight"], state["patch_embed.proj.bias"], stride=4)
    x = _norm(state, "patch_embed.norm", x[0].permute(1, 2, 0))
    inputs = []
    for stage in range(4):
        inputs.append(x)
        x = _blocks(state, f"layers.{stage}", x, stage)
        if stage < 3:
            merged = torch.cat([x[0::2, 0::2], x[1::2, 0::2], x[0::2, 1::2], x[1::2, 1::2]], dim=-1)
            down = f"layers.{stage}.downsample"
            x = _linear(state, f"{down}.reduction", _norm(state, f"{down}.norm", merged))
    x = _expanded(state, "layers_up.0", _norm(state, "norm", x), 2)
    for up in (1, 2, 3):
        x = _linear(state, f"concat_back_dim.{up}", torch.cat([x, inputs[3 - up]], dim=-1))
        x = _blocks(state, f"layers_up.{up}", x, 3 - up)
        if up < 3:
            x = _expanded(state, f"layers_up.{up}.upsample", x, 2)
    x = _expanded(state, "up", _norm(state, "norm_up", x), 4)
    return torch.stack(
        [x @ state[f"{head}_output.weight"][0, :, 0, 0] for head in ("pos", "cos", "sin", "width")]
    )


@pytest.mark.parametrize(("channels", "modality"), [(1, "d"), (3, "rgb"), (4, "rgbd")])
def test_a_published_state_dict_is_computed_as_its_authors_do(
    channels: int, modality: str, tmp_path: Path
) -> None:
    state = published(channels, seed=channels)
    torch.save(state, tmp_path / "published.pt")
    weights = load_weights("tfgrasp", tmp_path / "published.pt")
    assert weights.input.modality == modality
    assert weights.width_px == 150.0
    image = torch.randn(channels, SIZE, SIZE, generator=torch.Generator().manual_seed(9))
    with torch.inference_mode():
        ours = torch.cat(weights.network(image[None]), dim=1)[0]
        theirs = computed(state, image)
    assert theirs.std() > 0.1
    torch.testing.assert_close(ours, theirs, atol=2e-4, rtol=1e-3)


@pytest.mark.parametrize("change", ["lost", "another", "shape", "stage"])
def test_a_published_state_dict_that_is_not_whole_is_refused(change: str, tmp_path: Path) -> None:
    state = published()
    if change == "lost":
        del state["layers.1.blocks.0.attn.qkv.weight"]
    elif change == "another":
        state["layers.1.blocks.0.extra.weight"] = torch.zeros(3)
    elif change == "shape":
        state["up.norm.weight"] = torch.zeros(3)
    else:
        state = {key: value for key, value in state.items() if not key.startswith("layers.3.")}
    torch.save(state, tmp_path / "published.pt")
    with pytest.raises(WeightsError) as caught:
        load_weights("tfgrasp", tmp_path / "published.pt")
    assert "\n" not in str(caught.value)
