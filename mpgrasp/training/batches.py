"""Batches of each training step, prepared while the step before computes."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Generator
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
import torch
from torch import Tensor

from mpgrasp.training.dataset import GraspDataset
from mpgrasp.training.losses import to_tensors
from mpgrasp.training.trainer_config import TrainConfig

LOADERS = 8
"""Threads that prepare batches for a GPU, at most; a CPU that computes has no core to spare for a second."""


class Batches:
    """Training batches of `dataset`: each a function of the seed, the step and the data alone."""

    def __init__(
        self, config: TrainConfig, dataset: GraspDataset, width_px: float, device: torch.device
    ) -> None:
        self._config, self._dataset = config, dataset
        self._width_px, self._device = width_px, device

    def __len__(self) -> int:
        """Return the number of images in an epoch."""
        return len(self._deck())

    def ahead(self, step: int) -> Generator[tuple[Tensor, ...], None, None]:
        """Yield batches from that step on; close the iterator to stop the threads that prepare them."""
        threads = 1 if self._device.type == "cpu" else min(LOADERS, os.cpu_count() or 1)
        with ThreadPoolExecutor(threads) as loaders:
            waiting: deque[Future[tuple[Tensor, ...]]] = deque()
            try:
                while True:
                    while len(waiting) <= threads:
                        waiting.append(loaders.submit(self.draw, step))
                        step += 1
                    yield waiting.popleft().result()
            finally:
                for batch in waiting:
                    batch.cancel()

    def draw(self, step: int) -> tuple[Tensor, ...]:
        """Return image, quality, angle, width and valid of that step's batch; see losses.to_tensors."""
        rng = np.random.default_rng([self._config.seed, step])
        augmentation = self._config.augmentation
        batch = self._dataset.batch(
            self.chosen(step), self._config.input, rng if augmentation else None, augmentation
        )
        tensors = to_tensors(batch, self._width_px)
        return tensors if self._device.type == "cpu" else tuple(t.pin_memory() for t in tensors)

    def chosen(self, step: int) -> np.ndarray:
        """Return indices of that step's images: every epoch deals all of them, in an order of its own."""
        deck, size = self._deck(), self._config.batch
        epoch, place = np.divmod(step * size + np.arange(size), len(deck))
        dealt = [
            np.random.default_rng([self._config.seed, 0, e]).permutation(deck)[place[epoch == e]]
            for e in np.unique(epoch).tolist()
        ]
        return np.concatenate(dealt)

    def _deck(self) -> np.ndarray:
        """Return training images; those of thin objects as often as their weight says, on average."""
        images, thin = self._dataset.training, self._dataset.column("thin")
        if thin is None or self._config.thin_weight == 1:
            return images
        weight = np.where(thin[images] > 0.5, self._config.thin_weight, 1.0)
        luck = np.random.default_rng(self._config.seed).random(len(images))
        deck = np.repeat(images, (weight + luck).astype(np.intp))
        return deck if len(deck) else images
