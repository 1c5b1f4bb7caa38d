"""Weight files: safetensors that say which network they are for, and published state dicts."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors.torch import save_file
from torch import nn

from mpgrasp.depth import NETWORK_SIZE
from mpgrasp.detectors.networks.calibration import Calibration
from mpgrasp.detectors.networks.description import (
    FORMAT,
    check_name,
    check_weights_file,
    opened,
    read_description,
)
from mpgrasp.detectors.networks.entries import check_entries, check_numbers, stored_entries
from mpgrasp.detectors.networks.input import CHANNELS, NetworkInput
from mpgrasp.detectors.networks.registry import (
    NETWORKS,
    build_network,
    check_network,
    declaration,
    default_weights,
)
from mpgrasp.detectors.networks.state import entries, needed_entries, numbers
from mpgrasp.exceptions import ConfigError, OutputError, WeightsError
from mpgrasp.files.json_values import json_value

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
    calibration: Calibration | None = None
    """Of the claimed quality, if it was measured."""


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
        "card": json.dumps(json_value(weights.card)),
    }
    if weights.calibration is not None:
        metadata["calibration"] = json.dumps(asdict(weights.calibration))
    tensors = {k: v.detach().cpu().contiguous() for k, v in (state or weights.network.state_dict()).items()}
    temporary = path.with_name(path.name + ".part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        save_file(tensors, temporary, metadata=metadata)
        temporary.chmod(0o644)  # safetensors makes files that only their owner can read
        temporary.replace(path)
    except (OSError, SafetensorError) as error:
        raise OutputError(f"weights cannot be written: {error}", got=str(path)) from error


def load_weights(name: str, path: Path | str | None = None) -> NetworkWeights:
    """Read the weights of network `name`, by default the shipped ones, on the CPU and in evaluation mode.

    Raises:
        ConfigError: there is no such network.
        WeightsError: the file is missing, unreadable or made for another network.
    """
    check_network(name)
    file = Path(path) if path is not None else default_weights(name)
    check_weights_file(file)
    loaded = _read_published(name, file) if file.suffix in (".pt", ".pth") else _read_safetensors(name, file)
    loaded.network.eval()
    return loaded


def _read_safetensors(name: str, path: Path) -> NetworkWeights:
    about = read_description(path)
    check_name(about, name, path)
    needed = needed_entries(name, about.settings)
    with opened(path, "pt") as file:
        check_entries(stored_entries(file), needed, path)
        state = {key: file.get_tensor(key) for key in needed}
    check_numbers(numbers(state), path)
    network = build_network(name, about.settings)
    network.load_state_dict(state)
    return NetworkWeights(
        name=name,
        network=network,
        settings=about.settings,
        input=about.input,
        width_px=about.width_px,
        card=about.card,
        calibration=about.calibration,
    )


def _read_published(name: str, path: Path) -> NetworkWeights:
    declared = declaration(name)
    if declared.published is None:
        raise WeightsError(f"{name} reads safetensors only", got=str(path), allowed="a .safetensors file")
    allowed = f"a published state dict of {name}"
    try:
        # weights_only: a pickle from elsewhere must not run code
        state = torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:  # torch names no common base for what a junk file may raise
        if "Unsupported global" in str(error):  # a whole module, whose pickle would run code
            raise WeightsError(
                "a pickled module, which could run any code when it is read",
                got=str(path),
                allowed=f"{allowed}; if you trust it, make one where its code is installed: torch.save(torch"
                ".load(IN, weights_only=False, map_location='cpu').state_dict(), OUT)",
            ) from error
        raise WeightsError("not a PyTorch file of tensors", got=str(path), allowed=allowed) from error
    if not (isinstance(state, dict) and all(map(_is_tensor, state.items()))):
        raise WeightsError(
            f"{path}: not a state dict of dense tensors", got=type(state).__name__, allowed=allowed
        )
    if declared.published.entry not in state:
        for other in NETWORKS:
            published = declaration(other).published
            if published is not None and published.entry in state:
                raise WeightsError(f"weights of {other}, not of {name}", got=str(path), allowed=f"as {other}")
    settings = {setting: _size(state, *place) for setting, place in declared.published.sizes.items()}
    settings = {key: value for key, value in settings.items() if value is not None}
    if declared.published.read is not None:
        settings, state = declared.published.read(state)
    modality = next((kind for kind, n in CHANNELS.items() if n == settings.get("channels", 1)), None)
    if modality is None:
        raise WeightsError(
            f"{path}: weights for images of {settings['channels']} channels",
            allowed=str(sorted(CHANNELS.values())),
        )
    try:
        needed = needed_entries(name, settings)
    except ConfigError as error:
        raise WeightsError(f"{path}: {error}") from error
    check_entries(entries(state), needed, path)
    check_numbers(numbers(state), path)
    network = build_network(name, settings)
    network.load_state_dict(state)
    return NetworkWeights(
        name=name,
        network=network,
        settings=settings,
        input=NetworkInput(size=declared.input_size, modality=modality),
        width_px=declared.published.width_px,
        card=declared.published.card,
    )


def _size(state: Mapping[str, torch.Tensor], entry: str, axis: int) -> int | None:
    """Return the size of a tensor along an axis; None where there is none."""
    shape = state[entry].shape if entry in state else ()
    return int(shape[axis]) if axis < len(shape) else None


def _is_tensor(item: tuple[object, object]) -> bool:
    key, value = item
    dense = isinstance(value, torch.Tensor) and value.layout == torch.strided and not value.is_quantized
    return isinstance(key, str) and dense
