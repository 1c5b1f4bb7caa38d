"""State dicts of the authors' TF-Grasp (https://github.com/WangShaoSUN/grasp-transformer) for our network.

Names differ, the table of position biases lies the other way, and where 2 x 2 tokens are merged the second
and the third have changed places. Blocks of its decoder are counted from the coarsest, ours from the finest.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from torch import Tensor

from mpgrasp.detectors.networks.declaration import PublishedWeights

_BLOCK = {
    "attn.relative_position_bias_table": "attention.bias",
    "attn.qkv": "attention.qkv",
    "attn.proj": "attention.out",
    "mlp.fc1": "mlp.0",
    "mlp.fc2": "mlp.2",
}
_FIXED = {
    "patch_embed.proj": "patches",
    "patch_embed.norm": "patch_norm",
    "norm_up": "decoder_norm",
    "up.expand": "pixels.expand",
    "up.norm": "pixels.norm",
}
_COMPUTED = ("attn.relative_position_index", "attn_mask")  # buffers that follow from the sizes
_MERGED = (0, 2, 1, 3)  # places of our 2 x 2 tokens among theirs


def read_published(state: Mapping[str, Tensor]) -> tuple[dict[str, Any], dict[str, Tensor]]:
    """Return the settings of a published state dict, and its tensors by our names.

    What has another name than the published code gives keeps it, so that it is told as unknown.
    """
    stages = 1 + max((int(m[1]) for key in state if (m := re.match(r"layers\.(\d+)\.", key))), default=0)
    ours = {}
    for key, value in state.items():
        if not key.endswith(_COMPUTED):
            name = _renamed(key, stages)
            ours[name] = _laid_out(name, value)
    return _settings(state, stages), ours


def _settings(state: Mapping[str, Tensor], stages: int) -> dict[str, Any]:
    patches = state["patch_embed.proj.weight"]
    sizes = {"embed": patches.shape[0], "channels": patches.shape[1]} if patches.ndim == 4 else {}
    blocks = [re.compile(rf"layers\.{k}\.blocks\.(\d+)\.norm1\.weight") for k in range(stages)]
    depths = [sum(bool(block.fullmatch(key)) for key in state) for block in blocks]
    tables = [state.get(f"layers.{k}.blocks.0.attn.relative_position_bias_table") for k in range(stages)]
    found = [int(table.shape[1]) for table in tables if table is not None and table.ndim == 2]
    known = {"depths": depths, "heads": found} if len(found) == stages and all(depths) else {}
    return {**sizes, **known, "activation": "relu", "interleaved": False}


def _renamed(key: str, stages: int) -> str:
    for old, new in _FIXED.items():
        if key.startswith(old + "."):
            return new + key[len(old) :]
    found = re.fullmatch(r"(layers|layers_up)\.(\d+)\.blocks\.(\d+)\.(.+)", key)
    if found:
        side, stage, block, rest = found[1], int(found[2]), found[3], found[4]
        where = f"encoder.{stage}" if side == "layers" else f"decoder.{stages - 1 - stage}"
        for old, new in _BLOCK.items():
            if rest == old or rest.startswith(old + "."):
                rest = new + rest[len(old) :]
                break
        return f"{where}.{block}.{rest}"
    if found := re.fullmatch(r"layers\.(\d+)\.downsample\.(norm|reduction)\.(.+)", key):
        part = {"norm": "norm", "reduction": "reduce"}[found[2]]
        return f"merge.{found[1]}.{part}.{found[3]}"
    if found := re.fullmatch(r"layers_up\.0\.(expand|norm)\.(.+)", key):
        return f"expand.{stages - 2}.{found[1]}.{found[2]}"
    if found := re.fullmatch(r"layers_up\.(\d+)\.upsample\.(expand|norm)\.(.+)", key):
        return f"expand.{stages - 2 - int(found[1])}.{found[2]}.{found[3]}"
    if found := re.fullmatch(r"concat_back_dim\.(\d+)\.(.+)", key):
        return f"reduce.{stages - 1 - int(found[1])}.{found[2]}"
    return key


def _laid_out(name: str, value: Tensor) -> Tensor:
    """Return a tensor of that name of ours as our network has it."""
    if name.endswith("attention.bias") and value.ndim == 2:
        return value.T.contiguous()
    if name.startswith("merge.") and value.ndim and value.shape[-1] % 4 == 0:
        parts = value.reshape(*value.shape[:-1], 4, -1)
        return parts[..., list(_MERGED), :].reshape(value.shape)
    return value


PUBLISHED = PublishedWeights(
    entry="patch_embed.proj.weight",
    width_px=150.0,
    read=read_published,
    card={
        "data": "Cornell or Jacquard",
        "source": "https://github.com/WangShaoSUN/grasp-transformer",
        "licence": "none given",
    },
)
