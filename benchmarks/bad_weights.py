"""Weight files that must be refused: damaged, of another make, or with a description of what cannot be.

Each is made from a sound file of a small network by one change. Tests load them all; so can a study.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import torch
from safetensors.torch import save
from torch import Tensor

from mpgrasp.detectors.networks.registry import build_network

NETWORK = "dhrnet"
"""Network that all of them claim to be for."""
PUBLISHED = "ggcnn"
"""Network whose published state dicts the pickles claim to be."""

_SETTINGS = {"channels": 1, "width": 4, "stem_width": 4, "head_width": 4, "blocks": 1}
_INPUT = {"size": 224, "modality": "d", "centre": "median", "clip": 1.0, "scale": 20.0}
_BIAS = "pos_output.bias"


@dataclass(frozen=True, kw_only=True)
class BadWeights:
    """One such file."""

    content: Callable[[], bytes]
    """Makes the bytes of the file."""
    said: str
    """Regular expression that the error matches."""
    suffix: str = ".safetensors"
    network: str = NETWORK
    """Detector whose weights they are given as."""

    def write(self, folder: Path) -> Path:
        """Write the file into a folder, and return its path."""
        path = folder / f"bad{self.suffix}"
        path.write_bytes(self.content())
        return path


@cache
def _state() -> dict[str, Tensor]:
    torch.manual_seed(0)
    return dict(build_network(NETWORK, _SETTINGS).state_dict())


def sound(
    metadata: Mapping[str, str | None] | None = None, tensors: Mapping[str, Any] | None = None
) -> bytes:
    """Return a weights file of `NETWORK`, with other metadata and tensors; None leaves one out."""
    about: dict[str, str | None] = {
        "format": "mpgrasp-weights-1",
        "network": NETWORK,
        "settings": json.dumps(_SETTINGS),
        "input": json.dumps(_INPUT),
        "width_px": "112.0",
        "card": '{"licence": "Apache-2.0"}',
        **(metadata or {}),
    }
    state = {**_state(), **(tensors or {})}
    return save(
        {key: value for key, value in state.items() if value is not None},
        {key: value for key, value in about.items() if value is not None},
    )


def _told(said: str, **metadata: str | None) -> BadWeights:
    return BadWeights(content=lambda: sound(metadata), said=said)


def _input(said: str, **changes: Any) -> BadWeights:
    return _told(said, input=json.dumps({**_INPUT, **changes}))


def _settings(said: str, **changes: Any) -> BadWeights:
    return _told(said, settings=json.dumps({**_SETTINGS, **changes}))


def _tensor(said: str, change: Callable[[Tensor], Tensor | None], key: str = _BIAS) -> BadWeights:
    return BadWeights(content=lambda: sound(tensors={key: change(_state()[key])}), said=said)


def _raw(said: str, content: bytes, suffix: str = ".safetensors", network: str = NETWORK) -> BadWeights:
    return BadWeights(content=lambda: content, said=said, suffix=suffix, network=network)


def _pickle(said: str, made: Callable[[], Any], suffix: str = ".pt", network: str = PUBLISHED) -> BadWeights:
    def content() -> bytes:
        import io

        buffer = io.BytesIO()
        torch.save(made(), buffer)
        return buffer.getvalue()

    return BadWeights(content=content, said=said, suffix=suffix, network=network)


def _published(key: str, change: Callable[[Tensor], Any]) -> dict[str, Any]:
    state = dict(build_network(PUBLISHED, {}).state_dict())
    return {**state, key: change(state[key])}


def _sparse(value: Tensor) -> Tensor:
    return value.to_sparse()


BAD_WEIGHTS: dict[str, BadWeights] = {
    # files that are none
    "empty": _raw("cannot be read.*an empty file", b""),
    "text": _raw("cannot be read.*something else", b"not weights at all, just text"),
    "zeros": _raw("cannot be read", bytes(4096)),
    "endless-header": _raw("cannot be read", (2**62).to_bytes(8, "little") + b"{}"),
    "header-of-no-json": _raw("cannot be read", (8).to_bytes(8, "little") + b"{{{{{{{{"),
    "git-lfs": _raw("Git LFS pointer", b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n"),
    "hdf5": _raw("HDF5", b"\x89HDF\r\n\x1a\n" + bytes(100)),
    "truncated-header": BadWeights(content=lambda: sound()[:100], said="cannot be read"),
    "truncated": BadWeights(content=lambda: sound()[:-1], said="cannot be read.*a whole safetensors file"),
    "trailing": BadWeights(content=lambda: sound() + bytes(64), said="cannot be read"),
    "pickle-by-another-name": _pickle(
        "a PyTorch file", lambda: dict(_state()), suffix=".safetensors", network=NETWORK
    ),
    # pickles
    "pt-empty": _raw("not a PyTorch file", b"", ".pt", PUBLISHED),
    "pt-text": _raw("not a PyTorch file", b"just text", ".pth", PUBLISHED),
    "pt-for-safetensors-only": _pickle("reads safetensors only", lambda: dict(_state()), network=NETWORK),
    "pt-list": _pickle("not a state dict.*got 'list'", lambda: [torch.zeros(3)]),
    "pt-nested": _pickle("not a state dict", lambda: {"state_dict": {"conv1.weight": torch.zeros(3)}}),
    "pt-numbered": _pickle("not a state dict", lambda: {1: torch.zeros(3)}),
    "pt-whole-network": _pickle("a pickled module.*state_dict", lambda: build_network(PUBLISHED, {})),
    "pt-nothing": _pickle("20 missing", dict),
    "pt-integers": _pickle("wrong type.*int64", lambda: _published(_BIAS, lambda t: t.long())),
    "pt-sparse": _pickle("not a state dict of dense", lambda: _published(_BIAS, _sparse)),
    "pt-nan": _pickle("not finite", lambda: _published(_BIAS, lambda t: t * float("nan"))),
    "pt-shape": _pickle(
        r"first at pos_output\.bias.*got \(7,\)", lambda: _published(_BIAS, lambda t: t.new_zeros(7))
    ),
    # metadata
    "no-format": _told("not a weights file of mpgrasp", format=None),
    "another-format": _told("not a weights file.*'mpgrasp-weights-9'", format="mpgrasp-weights-9"),
    "no-network": _told("unknown network", network=None),
    "another-network": _told(
        "another network, not of dhrnet; got 'unet'; allowed: dhrnet", network="unet", settings="{}"
    ),
    "unheard-of-network": _told("unknown network; got 'resnet'", network="resnet"),
    "no-settings": _told("unusable settings; got 'nothing'", settings=None),
    "no-input": _told("unusable input; got 'nothing'", input=None),
    "no-card": _told("unusable card; got 'nothing'", card=None),
    "card-text": _told("card that is no table; got 'trust me'", card='"trust me"'),
    "card-list": _told("card that is no table", card="[1]"),
    "card-nan": _told("card is no JSON of finite numbers", card='{"loss": NaN}'),
    "card-cut": _told("card is no JSON", card='{"loss": '),
    "card-deep": _told("card is no JSON", card="[" * 100_000),
    "card-huge": _told("unusable card; got '[0-9]+ characters'", card=json.dumps({"a": "b" * 2**20})),
    "width-huge": _told(
        r"wrong unit of width; got 1000000000\.0; allowed: above 0, up to 896 px", width_px="1e9"
    ),
    "width-zero": _told("wrong unit of width; got 0", width_px="0"),
    "width-negative": _told("wrong unit of width; got -112", width_px="-112"),
    "width-infinite": _told("width_px is no JSON of finite", width_px="Infinity"),
    "width-overflow": _told("width_px is no JSON of finite", width_px="1e999"),
    "width-text": _told("wrong unit of width; got 'wide'", width_px='"wide"'),
    "width-true": _told("wrong unit of width; got True", width_px="true"),
    "width-digits": _told("width_px is no JSON|wrong unit of width", width_px="1" * 6000),
    "input-list": _told("input is not a table", input="[224]"),
    "input-unknown": _input("unknown key; got 'smell'", smell=1),
    "input-exbibytes": _input("unusable network input.*size 32 to 1024", size=10**9),
    "input-tiny": _input("unusable network input", size=3),
    "input-half": _input("input, size is unusable", size=224.5),
    "input-true": _input("input, size is unusable", size=True),
    "input-scale": _input("unusable network input.*scale above 0", scale=1e30),
    "input-scale-text": _input("input, scale is unusable", scale="much"),
    "input-clip": _input("unusable network input", clip=-1.0),
    "input-centre": _input("unknown centre", centre="mode"),
    "input-modality": _input("unknown modality", modality="lidar"),
    "input-range-channel": _input("unknown key; got 'range_channel'", range_channel=True),
    "input-channels": _input("wrong number of channels; got 1; allowed: 4", modality="rgbd"),
    "settings-list": _told("settings is not a table", settings="[1]"),
    "settings-unknown": _settings("unknown key; got 'depth'", depth=3),
    "settings-text": _settings("settings, width is unusable", width="wide"),
    "settings-true": _settings("settings, width is unusable", width=True),
    "settings-huge": _settings("unusable DHRNet settings.*1 to 4096 channels", width=10**9),
    "settings-endless": _settings("unusable DHRNet settings.*1 to 16 blocks", blocks=10**6),
    "settings-large": _settings("do not fit the network, first at", width=4096, stem_width=4096),
    "settings-modules": _settings("unusable DHRNet settings", modules=[1]),
    "settings-head": _settings("unknown head", head="left"),
    # tensors
    "tensor-missing": _tensor(r"got '1 missing: pos_output\.bias'", lambda _: None),
    "tensor-unexpected": BadWeights(
        content=lambda: sound(tensors={"extra": torch.zeros(1)}), said="got '1 unexpected: extra'"
    ),
    "tensor-renamed": BadWeights(
        content=lambda: sound(tensors={_BIAS: None, "bias": torch.zeros(1)}),
        said="1 missing: pos_output.bias; 1 unexpected: bias",
    ),
    "tensors-none": BadWeights(
        content=lambda: sound(tensors=dict.fromkeys(_state())), said="[0-9]+ missing: .* and [0-9]+ more"
    ),
    "tensor-shape": _tensor(
        r"first at pos_output\.bias; got \(7,\); allowed: \(1,\)", lambda t: t.new_zeros(7)
    ),
    "tensor-scalar": _tensor(r"first at pos_output\.bias; got \(\)", lambda t: t[0].clone()),
    "tensor-int64": _tensor(
        "wrong type.*got 'int64'; allowed: float16, bfloat16, float32", lambda t: t.long()
    ),
    "tensor-int8": _tensor("wrong type.*got 'int8'", lambda t: t.to(torch.int8)),
    "tensor-bool": _tensor("wrong type.*got 'bool'", lambda t: t.bool()),
    "tensor-float64": _tensor("wrong type.*got 'float64'", lambda t: t.double()),
    "tensor-float8": _tensor("wrong type.*F8", lambda t: t.to(torch.float8_e4m3fn)),
    "count-as-float": _tensor(
        "wrong type.*got 'float32'; allowed: int64", lambda t: t.float(), "stem_half.1.num_batches_tracked"
    ),
    "tensor-nan": _tensor(r"not finite, first at pos_output\.bias", lambda t: t * float("nan")),
    "tensor-infinite": _tensor("not finite", lambda t: t + float("inf")),
    "variance-negative": _tensor("variance below zero", lambda t: t - 2, "stem_half.1.running_var"),
}
"""The files by name."""
