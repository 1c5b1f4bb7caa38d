"""Training a network on shards, within a budget of epochs or minutes.

Defaults are the paper's (Section IV-A): AdamW, learning rate 1e-4, weight decay 5e-2, batches of 32, 50
epochs. A budget of minutes can take the place of epochs; the learning rate is annealed over whichever is
given. Convolutions run in bfloat16, images with channels last. What is validated and saved is a running
average of the weights.
"""

from __future__ import annotations

import dataclasses
import math
import time
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch

from mpgrasp.detectors.network_detector import postprocess
from mpgrasp.detectors.weights import WIDTH_PX, NetworkWeights, build_network, save_weights
from mpgrasp.exceptions import OutputError, WeightsError
from mpgrasp.training.dataset import Batch, GraspDataset
from mpgrasp.training.losses import grasp_loss
from mpgrasp.training.metrics import format_summary, judge, summarise
from mpgrasp.training.progress import ProgressLog
from mpgrasp.training.trainer_config import TrainConfig

CHECKPOINT_FORMAT = "mpgrasp-checkpoint-1"
LICENCE = "Apache-2.0"
WARM_UP = 0.03
"""Share of the budget over which the learning rate rises."""
FLOOR = 0.01
"""Learning rate at the end, as a share of the highest."""
CHECKPOINT_EVERY = 180.0
"""[s]"""


class Trainer:
    """One training run: steps, validation, checkpoints and the weights file `out`.

    Validation images are all of `validation`, where there is one, and else what `dataset` holds out.
    """

    def __init__(
        self,
        config: TrainConfig,
        dataset: GraspDataset,
        out: Path,
        validation: GraspDataset | None = None,
    ) -> None:
        self.config = config
        self.dataset = dataset
        self.validation = validation or dataset
        self.out = out
        self.device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        settings = {**config.settings, "channels": config.input.channels}
        with torch.random.fork_rng():
            torch.manual_seed(config.seed)
            network = build_network(config.name, settings)
        self.weights = NetworkWeights(
            name=config.name, network=network, settings=settings, input=config.input
        )
        network.to(device=self.device)
        self.network = network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.optimiser = torch.optim.AdamW(
            self.network.parameters(), lr=config.lr, weight_decay=config.weight_decay
        )
        self.average = {k: v.detach().clone() for k, v in self.network.state_dict().items()}
        self.step = 0
        self.elapsed = 0.0
        self.validated = 0.0
        self.best: dict[str, float] = {}

    @property
    def checkpoint(self) -> Path:
        """Where the state of the run is kept until it is done."""
        return self.out.with_suffix(".checkpoint")

    @property
    def parameters(self) -> int:
        """Numbers that are trained."""
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
        return max(1, math.ceil(self.config.epochs * len(self.dataset.training) / self.config.batch))

    def run(self, log: ProgressLog, *, stop_after: int | None = None) -> dict[str, float]:
        """Train to the end of the budget, or for `stop_after` steps, and return the best validation.

        Raises:
            OutputError: weights or checkpoint cannot be written.
        """
        last_step = self.step + stop_after if stop_after is not None else None
        start, saved = time.monotonic() - self.elapsed, time.monotonic()
        with ThreadPoolExecutor(1) as loader:
            upcoming = loader.submit(self._draw, self.step)
            while self.progress < 1 and self.step != last_step:
                batch, upcoming = self._next(loader, upcoming)
                losses = self.train_step(batch)
                self.elapsed = time.monotonic() - start
                log.update(self.progress, self.step, self.step * self.config.batch, losses)
                if self.progress >= min(self.validated + self.config.validate_every, 1.0):
                    upcoming.result()  # nobody reads the shards while more are added
                    self._validate(log)
                    upcoming = loader.submit(self._draw, self.step)
                    self.elapsed = time.monotonic() - start
                if time.monotonic() - saved > CHECKPOINT_EVERY:
                    self.save_checkpoint()
                    saved = time.monotonic()
        self.save_checkpoint()
        return self.best

    def train_step(self, batch: Batch) -> dict[str, float]:
        """One step of the optimiser; returns the losses."""
        self.network.train()
        for group in self.optimiser.param_groups:
            group["lr"] = self.config.lr * self._rate()
        image = torch.from_numpy(batch.image).to(self.device).contiguous(memory_format=torch.channels_last)
        with torch.autocast(self.device.type, torch.bfloat16):
            heads = self.network(image)
        quality, angle, width, valid = (
            torch.from_numpy(np.ascontiguousarray(a)).to(self.device)
            for a in (batch.quality, batch.angle, batch.width / np.float32(WIDTH_PX), batch.valid)
        )
        parts = grasp_loss(heads, quality, angle, width, valid, self.config.loss)
        self.optimiser.zero_grad(set_to_none=True)
        parts["loss"].backward()
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), 5.0)
        self.optimiser.step()
        self.step += 1
        self._update_average()
        return {k: float(v.detach()) for k, v in parts.items()}

    def _next(self, loader: ThreadPoolExecutor, upcoming: Future[Batch]) -> tuple[Batch, Future[Batch]]:
        batch = upcoming.result()
        return batch, loader.submit(self._draw, self.step + 1)

    def _draw(self, step: int) -> Batch:
        """The batch of that step: a function of the seed, the step and the data alone."""
        rng = np.random.default_rng([self.config.seed, step])
        images = self.dataset.training
        thin = self.dataset.column("thin")
        weight = np.ones(len(images))
        if thin is not None:
            weight[thin[images] > 0.5] = self.config.thin_weight
        few = len(images) < self.config.batch
        chosen = rng.choice(images, self.config.batch, replace=few, p=weight / weight.sum())
        augmentation = self.config.augmentation
        return self.dataset.batch(chosen, self.config.input, rng if augmentation else None, augmentation)

    def _rate(self) -> float:
        if self.progress < WARM_UP:
            return max(self.progress / WARM_UP, 0.01)
        if self.config.schedule == "constant":
            return 1.0
        phase = (self.progress - WARM_UP) / (1 - WARM_UP)
        return FLOOR + (1 - FLOOR) * 0.5 * (1 + math.cos(math.pi * phase))

    @torch.no_grad()
    def _update_average(self) -> None:
        # young averages forget faster, so that the initial weights are soon gone
        decay = min(self.config.average, self.step / (self.step + 10)) if self.config.average else 0.0
        for key, value in self.network.state_dict().items():
            if value.is_floating_point():
                self.average[key].lerp_(value, 1 - decay)
            else:
                self.average[key].copy_(value)

    def _validate(self, log: ProgressLog) -> None:
        self.validated = self.progress
        summary = self.evaluate()
        log.note(f"{100 * self.progress:.0f} % validation  " + format_summary(summary))
        # equal counts as better: of two the one that was trained longer
        if summary.get("hit", 0.0) >= self.best.get("hit", 0.0):
            self.best = summary
            self.save()
        arrived = self.dataset.refresh()
        if arrived:
            log.note(f"{arrived} more shards, {len(self.dataset.training)} training images")

    @property
    def validation_images(self) -> np.ndarray:
        """Indices into `validation`, the same ones every time."""
        data = self.validation
        images = data.held if data is self.dataset else np.arange(len(data))
        return np.random.default_rng(0).permutation(images)[: self.config.validation_images]

    @torch.inference_mode()
    def evaluate(self) -> dict[str, float]:
        """Validation of the averaged weights; see metrics.summarise."""
        images = self.validation_images
        own = {k: v.clone() for k, v in self.network.state_dict().items()}
        self.network.load_state_dict(self.average)
        self.network.eval()
        verdicts, graspable = {}, {}
        for chunk in np.array_split(images, max(1, math.ceil(len(images) / 16))):
            for i, heads in zip(chunk.tolist(), self._heads(chunk), strict=True):
                truth = self.validation.sample(i)
                verdicts[i] = judge(*postprocess(heads, WIDTH_PX), truth)
                graspable[i] = bool(truth.quality.any())
        self.network.load_state_dict(own)
        return summarise(verdicts, graspable, self.validation)

    def _heads(self, images: np.ndarray) -> np.ndarray:
        if not len(images):
            return np.zeros((0, 4, 0, 0), np.float32)
        batch = torch.from_numpy(self.validation.batch(images, self.config.input).image).to(self.device)
        with torch.autocast(self.device.type, torch.bfloat16):
            heads = self.network(batch.contiguous(memory_format=torch.channels_last))
        return torch.cat(heads, dim=1).float().cpu().numpy()

    def save(self) -> None:
        """Write the averaged weights with their training card."""
        weights = dataclasses.replace(self.weights, card=self._card())
        save_weights(self.out, weights, self.average)

    def _card(self) -> dict[str, Any]:
        config = self.config
        return {
            "data": self.dataset.description(),
            "validation_data": self.validation.description(),
            "training_images": len(self.dataset.training),
            "training_scenes": self.dataset.scene_count,
            "images_seen": self.step * config.batch,
            "steps": self.step,
            "minutes": round(self.elapsed / 60, 1),
            "device": self.device.type,
            "threads": torch.get_num_threads(),
            "torch": torch.__version__,
            "seed": config.seed,
            "parameters": self.parameters,
            "optimiser": f"AdamW, lr {config.lr:g} {config.schedule}, weight decay {config.weight_decay:g}",
            "config": {k: v for k, v in asdict(config).items() if k not in ("name", "settings", "input")},
            "validation": {k: round(v, 4) for k, v in self.best.items()},
            "licence": LICENCE,
        }

    def save_checkpoint(self) -> None:
        """Write everything that a later `resume` needs.

        Raises:
            OutputError: the file cannot be written.
        """
        state = {
            "format": CHECKPOINT_FORMAT,
            "name": self.config.name,
            "settings": dict(self.weights.settings),
            "network": self.network.state_dict(),
            "average": self.average,
            "optimiser": self.optimiser.state_dict(),
            "step": self.step,
            "elapsed": self.elapsed,
            "validated": self.validated,
            "best": self.best,
        }
        temporary = self.checkpoint.with_name(self.checkpoint.name + ".part")
        try:
            temporary.parent.mkdir(parents=True, exist_ok=True)
            torch.save(state, temporary)
            temporary.replace(self.checkpoint)
        except (OSError, RuntimeError) as error:
            raise OutputError(f"checkpoint cannot be written: {error}", got=str(self.checkpoint)) from error

    def resume(self) -> bool:
        """Continue where the checkpoint left off; False where there is none.

        Raises:
            WeightsError: the checkpoint is unreadable or of another network.
        """
        if not self.checkpoint.is_file():
            return False
        try:
            state = torch.load(self.checkpoint, map_location=self.device, weights_only=True)
            if state["format"] != CHECKPOINT_FORMAT or state["name"] != self.config.name:
                raise KeyError("made for another network")
            self.network.load_state_dict(state["network"])
            self.optimiser.load_state_dict(state["optimiser"])
        except Exception as error:  # torch names no common base for what a broken file may raise
            raise WeightsError(f"checkpoint cannot be used: {error}", got=str(self.checkpoint)) from error
        self.average = state["average"]
        self.step, self.elapsed = int(state["step"]), float(state["elapsed"])
        self.validated, self.best = float(state["validated"]), dict(state["best"])
        return True
