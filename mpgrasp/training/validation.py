"""Validation of a network in training: by labels, and by simulated lifts of what it would grasp."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import nn

from mpgrasp.detectors.network_detector import LARGEST, postprocess
from mpgrasp.detectors.networks.registry import OPENING_FULLY
from mpgrasp.training.dataset import GraspDataset
from mpgrasp.training.losses import grasp_loss, to_tensors
from mpgrasp.training.metrics import match_labels, summarise
from mpgrasp.training.trainer_config import TrainConfig

if TYPE_CHECKING:
    from mpgrasp.training.lifts import LiftCheck

BATCH = 16
"""Images at a time."""


def selected_by(name: str) -> str:
    """Return the figure by which the weights of a network that are kept are the best.

    A share of hits counts images one by one, and over a few hundred of them luck moves it by more than two
    good networks differ; the score grades every image by how good the label is that the network would grasp,
    wants angle and opening to agree as a hit does, and covers all validation images, while lifts are
    simulated for some. Of a network that claims no opening the quality of that label counts.
    """
    return "label_quality" if name in OPENING_FULLY else "score"


class Validator:
    """Judges a network on images of `data`: the held-out ones where `held` is true, else all.

    Raises:
        ConfigError: lifts are asked for and the shards do not tell scenes and poses.
    """

    def __init__(
        self, config: TrainConfig, data: GraspDataset, width_px: float, device: torch.device, *, held: bool
    ) -> None:
        self._config, self._data, self._held = config, data, held
        self._width_px, self._device = width_px, device
        self._lifts: LiftCheck | None = None
        self._chosen_to_lift()

    @property
    def images(self) -> np.ndarray:
        """Indices into the data, the same ones every time as long as no shards are added."""
        images = self._data.held if self._held else np.arange(len(self._data))
        return np.random.default_rng(0).permutation(images)[: self._config.validation_images]

    @torch.inference_mode()
    def evaluate(self, network: nn.Module) -> dict[str, float]:
        """Return metrics.summarise and "validation_loss"; the network is left in evaluation mode.

        That loss is of the maps, for all networks alike, also for one that is trained by a loss of its own.

        Raises:
            FloatingPointError: an output of the network is not finite, or beyond `LARGEST`.
        """
        network.eval()
        images, lift = self.images, self._chosen_to_lift()
        matches, graspable, lifted = {}, {}, {}
        total = 0.0
        for chunk in np.array_split(images, math.ceil(len(images) / BATCH)) if len(images) else ():
            heads, loss = self._run(network, chunk)
            if not (np.abs(heads) < LARGEST).all():  # as for a detector; wider ones overflow on the way
                raise FloatingPointError("an output of the network is not finite")
            total += loss * len(chunk)
            for i, maps in zip(chunk.tolist(), heads, strict=True):
                truth = self._data.sample(i).resized(self._config.input.size)
                best = postprocess(maps, self._width_px)
                matches[i] = match_labels(*best, truth)
                graspable[i] = bool(truth.quality.any())
                if i in lift:
                    lifted[i] = self._lift_check().lifts(i, truth, *best)
        summary = summarise(matches, graspable, self._data, lifted)
        return summary | ({"validation_loss": total / len(images)} if len(images) else {})

    def _run(self, network: nn.Module, chunk: np.ndarray) -> tuple[np.ndarray, float]:
        """Return raw heads (n, 4, H, W), and the mean loss."""
        batch = self._data.batch(chunk, self._config.input)
        image, quality, angle, width, valid = (t.to(self._device) for t in to_tensors(batch, self._width_px))
        low = self._config.precision == "bfloat16"
        with torch.autocast(self._device.type, torch.bfloat16, enabled=low):
            heads = network(image.contiguous(memory_format=torch.channels_last))
        pos, cos, sin, opening = (h.float() for h in heads)
        loss = grasp_loss((pos, cos, sin, opening), quality, angle, width, valid, self._config.loss)["loss"]
        return torch.cat([pos, cos, sin, opening], dim=1).cpu().numpy(), float(loss)

    def _chosen_to_lift(self) -> set[int]:
        if not self._config.lift_images:
            return set()
        from mpgrasp.training.lifts import images_to_lift

        return set(images_to_lift(self._data, self.images, self._config.lift_images))

    def _lift_check(self) -> LiftCheck:
        from mpgrasp.training.lifts import LiftCheck

        self._lifts = self._lifts or LiftCheck(self._data)
        return self._lifts
