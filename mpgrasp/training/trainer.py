"""Training a network on shards, within a budget of epochs or minutes.

Defaults are the paper's (Section IV-A): AdamW, learning rate 1e-4, weight decay 5e-2, batches of 32, 50
epochs. It names no schedule: after a warm-up the rate falls along a cosine, over epochs or over a budget of
minutes, whichever is given. Biases, normalisations and relative positions are not decayed, as is usual.
Convolutions run in bfloat16, images with channels last. What is validated and saved is a running average of
the weights.

A run measured in epochs is a function of the settings, the seed and the data: on a CPU, one that was stopped
and resumed gives the same weights to the bit as one that was not.
"""

from __future__ import annotations

import dataclasses
import math
import time
from pathlib import Path

import torch
from torch import Tensor, nn

from mpgrasp.detectors.networks.declaration import Target
from mpgrasp.detectors.networks.registry import build_network
from mpgrasp.detectors.networks.weights import NetworkWeights, save_weights, width_unit
from mpgrasp.exceptions import ConfigError, WeightsError
from mpgrasp.training.batches import Batches
from mpgrasp.training.card import TrainingRecord
from mpgrasp.training.checkpoint import read_checkpoint, write_checkpoint
from mpgrasp.training.curves import write_curves
from mpgrasp.training.dataset import GraspDataset
from mpgrasp.training.losses import PARTS, batch_loss
from mpgrasp.training.metrics import format_summary
from mpgrasp.training.optimiser import make_optimiser, rate_at, update_average
from mpgrasp.training.progress import ProgressLog
from mpgrasp.training.start import start_from
from mpgrasp.training.trainer_config import TrainConfig
from mpgrasp.training.validation import Validator, selected_by

MAX_GRADIENT = 5.0
"""Gradients are shortened to this norm."""
CHECKPOINT_EVERY = 180.0
"""Time between checkpoints [s]."""
RESUMED = ("step", "elapsed", "validated", "best", "history", "average", "start")
"""What a checkpoint holds of a run beside network, optimiser and losses."""
READ_EVERY = 20
"""Losses of a GPU are read after so many steps, since each reading waits for it."""


class Trainer:
    """One training run: steps, validation, checkpoints, curves, and the weights file `out`.

    Validation images are all of `validation`, where there is one, and else what `dataset` holds out.

    Args:
        config: settings of the training.
        dataset: images to train on.
        out: weights file; the checkpoint lies beside it.
        validation: images to validate on.
        curves: CSV file of the curves, with a PNG beside it; by default they lie beside `out`.
        command: command that started the run, for the training card.
        start: weights file to go on from; random weights by default.

    Raises:
        ConfigError: a network that cannot be built, or data that cannot be validated on.
        WeightsError: weights to go on from that do not fit.
    """

    def __init__(
        self,
        config: TrainConfig,
        dataset: GraspDataset,
        out: Path,
        validation: GraspDataset | None = None,
        *,
        curves: Path | None = None,
        command: str = "",
        start: Path | None = None,
    ) -> None:
        self.config, self.dataset, self.out = config, dataset, out
        self.validation = validation or dataset
        self.curves, self.command = curves or out.with_suffix(".csv"), command
        self.device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        settings = {**config.settings, "channels": config.input.channels}
        with torch.random.fork_rng():
            torch.manual_seed(config.seed)
            network = build_network(config.name, settings)
        self.weights = NetworkWeights(
            name=config.name,
            network=network,
            settings=settings,
            input=config.input,
            # a width output of 1 is the same share of every image
            width_px=width_unit(config.input.size),
        )
        self.start = None if start is None else start_from(start, self.weights)
        network.to(device=self.device)
        self.network = network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.validator = Validator(
            config, self.validation, self.weights.width_px, self.device, held=self.validation is dataset
        )
        self.batches = Batches(config, dataset, self.weights.width_px, self.device)
        self.optimiser = make_optimiser(self.network, config)
        self.average = {k: v.detach().clone() for k, v in self.network.state_dict().items()}
        self.step = 0
        self.elapsed = 0.0
        self.validated = 0.0
        self.best: dict[str, float] = {}
        self.history: list[dict[str, float]] = []
        self._losses = torch.zeros(len(PARTS) + 1, dtype=torch.float64)  # sums since a validation, and steps
        self._stopped = False

    @property
    def checkpoint(self) -> Path:
        """File that keeps the state of the run."""
        return self.out.with_suffix(".checkpoint")

    @property
    def parameters(self) -> int:
        """Number of values that are trained."""
        return sum(p.numel() for p in self.network.parameters())

    @property
    def progress(self) -> float:
        """Share of the budget that is spent, in [0, 1]."""
        if self.config.minutes is not None:
            return min(self.elapsed / 60 / self.config.minutes, 1.0)
        return min(self.step / self.total_steps, 1.0)

    @property
    def total_steps(self) -> int:
        """Steps of a run that is measured in epochs."""
        return max(1, math.ceil(self.config.epochs * len(self.batches) / self.config.batch))

    def stop(self) -> None:
        """End `run` after the step that is under way."""
        self._stopped = True

    def run(self, log: ProgressLog, *, stop_after: int | None = None) -> dict[str, float]:
        """Train to the end of the budget, or for `stop_after` steps, and return the best validation.

        Raises:
            ConfigError: the loss, a weight or an output of the network is no longer finite.
            OutputError: weights, curves or checkpoint cannot be written.
        """
        last_step = None if stop_after is None else self.step + stop_after
        start, saved = time.monotonic() - self.elapsed, time.monotonic()
        batches = self.batches.ahead(self.step)
        pending: list[Tensor] = []
        every = 1 if self.device.type == "cpu" else READ_EVERY
        while self.progress < 1 and self.step != last_step and not self._stopped:
            pending.append(self.train_step(next(batches)))
            self.elapsed = time.monotonic() - start
            due = self.progress >= min(self.validated + self.config.validate_every, 1.0)
            if due or len(pending) == every:
                self._read_losses(pending, log)
                pending = []
            if due:
                batches.close()  # nobody reads the shards while more are added
                self._validate(log)
                batches = self.batches.ahead(self.step)
                self.elapsed = time.monotonic() - start
            if time.monotonic() - saved > CHECKPOINT_EVERY:
                self._read_losses(pending, log)
                self.save_checkpoint()
                pending, saved = [], time.monotonic()
        batches.close()
        self._read_losses(pending, log)
        self.save_checkpoint()
        return self.best

    def train_step(self, batch: tuple[Tensor, ...]) -> Tensor:
        """Take one step on (image, quality, angle, width, valid) and return the losses `PARTS`."""
        self.network.train()
        for group in self.optimiser.param_groups:
            group["lr"] = self.config.lr * rate_at(self.progress, self.config.schedule)
        image, *labels = (t.to(self.device, non_blocking=True) for t in batch)
        image = image.contiguous(memory_format=torch.channels_last)
        parts = batch_loss(self.network, image, Target(*labels), self.config, self.step)
        self.optimiser.zero_grad(set_to_none=True)
        torch.autograd.backward(parts["loss"])
        nn.utils.clip_grad_norm_(self.network.parameters(), MAX_GRADIENT)
        self.optimiser.step()
        self.step += 1
        update_average(self.average, self.network, self.config.average, self.step)
        return torch.stack([parts[name].detach() for name in PARTS])

    def _read_losses(self, steps: list[Tensor], log: ProgressLog) -> None:
        if not steps:
            return
        losses = torch.stack(steps).double().cpu()
        if not losses.isfinite().all():
            raise self._diverged("the loss")
        self._losses += torch.cat([losses.sum(dim=0), torch.tensor([len(steps)])])
        means = dict(zip(PARTS, losses.mean(dim=0).tolist(), strict=True))
        log.update(self.progress, self.step, self.step * self.config.batch, means)

    def _validate(self, log: ProgressLog) -> None:
        self.validated = self.progress
        summary = self.evaluate()
        log.validated(self.step, summary, f"{100 * self.progress:.0f} %", format_summary(summary))
        # equal counts as better: of two the one that was trained longer
        by = selected_by(self.config.name)
        if summary.get(by, 0.0) >= self.best.get(by, 0.0):
            self.best = summary
            self.save()
        *sums, steps = self._losses.tolist()
        so_far = {"progress": self.progress, "step": self.step, "images": self.step * self.config.batch}
        means = {name: value / max(steps, 1) for name, value in zip(PARTS, sums, strict=True)}
        self.history.append({**so_far, "minutes": self.elapsed / 60, **means, **summary})
        self._losses.zero_()
        write_curves(self.curves, self.history)
        arrived = self.dataset.refresh()
        if arrived:
            log.note(f"{arrived} more shards, {len(self.dataset.training)} training images")

    def _diverged(self, what: str) -> ConfigError:
        """Return the error of a training that has left the finite numbers; what was saved before stays."""
        kept = [str(file) for file in (self.out, self.checkpoint) if file.is_file()]
        kept_words = f"; kept from before: {', '.join(kept)}" if kept else ""
        return ConfigError(
            f"the training diverged: {what} at step {self.step} is no longer finite",
            got=f"--lr {self.config.lr:g}, --precision {self.config.precision}",
            allowed=f"a lower --lr, or --precision float32{kept_words}",
        )

    def _require_finite_weights(self) -> None:
        values = (*self.network.state_dict().values(), *self.average.values())
        if not all(bool(value.isfinite().all()) for value in values):
            raise self._diverged("a weight")

    def evaluate(self) -> dict[str, float]:
        """Validate the averaged weights and return the summary; see Validator.

        Raises:
            ConfigError: weights, or what the network makes of images, are no longer finite.
        """
        self._require_finite_weights()
        own = {k: v.clone() for k, v in self.network.state_dict().items()}
        self.network.load_state_dict(self.average)
        try:
            summary = self.validator.evaluate(self.network)
        except FloatingPointError:
            raise self._diverged("an output of the network") from None
        self.network.load_state_dict(own)
        return summary

    def save(self) -> None:
        """Write the averaged weights with their training card."""
        weights = dataclasses.replace(self.weights, card=self._record().card())
        save_weights(self.out, weights, self.average)

    def _record(self) -> TrainingRecord:
        return TrainingRecord(
            command=self.command,
            config=self.config,
            data=self.dataset.description(),
            validation_data=self.validation.description(),
            training_images=len(self.dataset.training),
            training_scenes=self.dataset.scene_count,
            steps=self.step,
            elapsed=self.elapsed,
            start=self.start,
            device=self.device.type,
            parameters=self.parameters,
            best=self.best,
        )

    def save_checkpoint(self) -> None:
        """Write everything that a later `resume` needs.

        Raises:
            ConfigError: a weight is no longer finite; the checkpoint from before stays.
            OutputError: the file cannot be written.
        """
        self._require_finite_weights()
        state = {"network": self.network.state_dict(), "optimiser": self.optimiser.state_dict()}
        state |= {"losses": self._losses, **{name: getattr(self, name) for name in RESUMED}}
        write_checkpoint(self.checkpoint, self.config, state)

    def resume(self) -> bool:
        """Continue where the checkpoint left off; False where there is none.

        Raises:
            WeightsError: the checkpoint is unreadable, or of a run with other settings or first weights.
        """
        if not self.checkpoint.is_file():
            return False
        state = read_checkpoint(self.checkpoint, self.config, self.device)
        if self.start not in (None, state.get("start")):
            raise WeightsError("checkpoint of a run that began with other weights", got=str(self.checkpoint))
        try:
            self.network.load_state_dict(state["network"])
            self.optimiser.load_state_dict(state["optimiser"])
            self._losses = state["losses"].cpu()
            for name in RESUMED:
                setattr(self, name, state[name])
        except (KeyError, ValueError, RuntimeError) as error:
            raise WeightsError(f"checkpoint cannot be used: {error}", got=str(self.checkpoint)) from error
        return True
