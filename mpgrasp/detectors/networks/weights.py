"""Weight files: safetensors that say which network they are for, and published state dicts."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import nn

from mpgrasp import paths
from mpgrasp.depth import NETWORK_SIZE
from mpgrasp.detectors.networks.input import NetworkInput
from mpgrasp.detectors.networks.registry import NETWORKS, build_network, check_network, declaration
from mpgrasp.exceptions import OutputError, WeightsError

FORMAT = "mpgrasp-weights-1"
WIDTH_SHARE = 0.5
"""Opening that a width output of 1 stands for in networks trained here, as a share of their image's side: 150
of 300 px, as in the published GG-CNN files."""


def width_unit(size: int) -> float:
    """Return the opening that a width output of 1 stands for in networks trained here on such images [px]."""
    return WIDTH_SHARE * size


@dataclass(frozen=True, kw_only=True, eq=False)
class NetworkWeights:
    """A network with its weights, and what has to be known to use it."""

    name: str
    """Name in the registry of networks."""
    network: nn.Module
    settings: Mapping[str, Any]
    """Keyword arguments of the network's config."""
    input: NetworkInput = field(default_factory=NetworkInput)
    width_px: float = width_unit(NETWORK_SIZE)
    """Opening that a width output of 1 stands for, in pixels of the network's image [px]."""
    card: Mapping[str, Any] = field(default_factory=dict)
    """Training card: data, seed, steps, time, metrics, licence."""


def save_weights(
    path: Path, weights: NetworkWeights, state: Mapping[str, torch.Tensor] | None = None
) -> None:
    """Write a weights file; `state` replaces the network's own state dict (averaged weights, say).

    Raises:
        OutputError: the file cannot be written.
    """
    metadata = {
        "format": FORMAT,
        "network": weights.name,
        "settings": json.dumps(dict(weights.settings)),
        "input": json.dumps(asdict(weights.input)),
        "width_px": json.dumps(weights.width_px),
        "card": json.dumps(dict(weights.card)),
    }
    tensors = {k: v.detach().cpu().contiguous() for k, v in (state or weights.network.state_dict()).items()}
    temporary = path.with_name(path.name + ".part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        save_file(tensors, temporary, metadata=metadata)
        temporary.chmod(0o644)  # safetensors makes files that only their owner can read
        temporary.replace(path)
    except (OSError, SafetensorError) as error:
        raise OutputError(f"weights cannot be written: {error}", got=str(path)) from error


def default_weights(name: str) -> Path:
    """Return the path of a network's shipped weights."""
    return paths.WEIGHTS / f"{name}.safetensors"


def load_weights(name: str, path: Path | str | None = None) -> NetworkWeights:
    """Read the weights of network `name`, by default the shipped ones, on the CPU and in evaluation mode.

    Raises:
        ConfigError: there is no such network.
        WeightsError: the file is missing, unreadable or made for another network.
    """
    check_network(name)
    file = Path(path) if path is not None else default_weights(name)
    if not file.is_file():
        raise WeightsError("no such weights file", got=str(file), allowed="a .safetensors, .pt or .pth file")
    loaded = _read_published(name, file) if file.suffix in (".pt", ".pth") else _read_safetensors(name, file)
    loaded.network.eval()
    return loaded


def read_card(path: Path | str) -> dict[str, Any]:
    """Return all that a safetensors file says about itself: network, settings, input and training card.

    Raises:
        WeightsError: the file is unreadable or of another make.
    """
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
    except (OSError, SafetensorError) as error:
        raise WeightsError(f"weights cannot be read: {error}", got=str(path)) from error
    if metadata.get("format") != FORMAT:
        raise WeightsError(
            "not a weights file of mpgrasp", got=str(path), allowed=f"safetensors with format {FORMAT}"
        )
    try:
        keys = ("settings", "input", "width_px", "card")
        return {"network": metadata["network"], **{k: json.loads(metadata[k]) for k in keys}}
    except (KeyError, json.JSONDecodeError) as error:
        raise WeightsError(f"weights with a broken description: {error!r}", got=str(path)) from error


def _read_safetensors(name: str, path: Path) -> NetworkWeights:
    about = read_card(path)
    if about["network"] != name:
        raise WeightsError(f"weights of another network, not of {name}", got=about["network"], allowed=name)
    try:
        with safe_open(path, framework="pt") as file:
            state = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118 (not a mapping)
        network = build_network(name, about["settings"])
        image = NetworkInput(**about["input"])
        width_px = float(about["width_px"])
    except (OSError, SafetensorError, ValueError, TypeError) as error:  # a ConfigError is a ValueError
        raise WeightsError(f"weights cannot be used: {error}", got=str(path)) from error
    if not (math.isfinite(width_px) and width_px > 0):
        raise WeightsError("weights with a wrong unit of width", got=width_px, allowed="above 0 px")
    channels = about["settings"].get("channels", 1)
    if channels != image.channels:
        raise WeightsError(
            "weights with a wrong number of channels", got=channels, allowed=str(image.channels)
        )
    if getattr(network.config, "size", image.size) != image.size:
        raise WeightsError(
            "weights for images of another size", got=network.config.size, allowed=str(image.size)
        )
    _load_state(network, state, path)
    return NetworkWeights(
        name=name,
        network=network,
        settings=about["settings"],
        input=image,
        width_px=width_px,
        card=about["card"],
    )


def _read_published(name: str, path: Path) -> NetworkWeights:
    declared = declaration(name)
    if declared.published is None:
        raise WeightsError(f"{name} reads safetensors only", got=str(path), allowed="a .safetensors file")
    try:
        # weights_only: a pickle from elsewhere must not run code
        state = torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:  # torch names no common base for what a junk file may raise
        raise WeightsError(
            "not a PyTorch file of tensors", got=str(path), allowed=f"a published state dict of {name}"
        ) from error
    if not isinstance(state, dict) or not all(isinstance(v, torch.Tensor) for v in state.values()):
        raise WeightsError("not a state dict", got=str(path), allowed=f"a published state dict of {name}")
    if declared.published.entry not in state:
        for other in NETWORKS:
            published = declaration(other).published
            if published is not None and published.entry in state:
                raise WeightsError(f"weights of {other}, not of {name}", got=str(path), allowed=f"as {other}")
    network = build_network(name, {})
    _load_state(network, state, path)
    return NetworkWeights(
        name=name,
        network=network,
        settings={},
        input=NetworkInput(size=declared.input_size),
        width_px=declared.published.width_px,
        card=declared.published.card,
    )


def _load_state(network: nn.Module, state: Mapping[str, torch.Tensor], path: Path) -> None:
    expected = {key: tuple(value.shape) for key, value in network.state_dict().items()}
    found = {key: tuple(value.shape) for key, value in state.items()}
    if expected != found:
        odd = sorted(key for key in expected.keys() | found.keys() if expected.get(key) != found.get(key))
        raise WeightsError(
            f"weights do not fit the network, first at {odd[0]}: shape {found.get(odd[0], 'missing')}",
            got=str(path),
            allowed=str(expected.get(odd[0], "no such entry")),
        )
    if not all(torch.isfinite(value).all() for value in state.values()):
        raise WeightsError("weights that are not finite", got=str(path), allowed="finite numbers")
    network.load_state_dict(state)
