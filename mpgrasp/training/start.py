"""Weights that a training goes on from, instead of random ones."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from mpgrasp.detectors.networks.weights import NetworkWeights, load_weights
from mpgrasp.exceptions import WeightsError


def start_from(file: Path, weights: NetworkWeights) -> dict[str, Any]:
    """Copy the weights of a file into a network, and return what the training card tells of them.

    Args:
        file: weights of the same network, with the same settings and input.
        weights: the network that is to be trained.

    Returns:
        Name and SHA-256 of the file, and its own training card.

    Raises:
        WeightsError: the file is unreadable, or of another network, settings or input.
    """
    found = load_weights(weights.name, file)
    for what in ("settings", "input", "width_px"):
        theirs, ours = getattr(found, what), getattr(weights, what)
        if theirs != ours:
            raise WeightsError(f"{file}: weights of other {what}", got=theirs, allowed=str(ours))
    weights.network.load_state_dict(found.network.state_dict())
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    return {"file": file.name, "sha256": digest, "card": dict(found.card)}
