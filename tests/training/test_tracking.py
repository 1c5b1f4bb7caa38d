"""A training can be watched while it lasts, in what is installed for that."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from mpgrasp.exceptions import ConfigError
from mpgrasp.training.progress import ProgressLog
from mpgrasp.training.tracking import make_tracker

WEIGHTS = Path("out/net.safetensors")


class Notes:
    """Stands for both services: keeps what it is told."""

    def __init__(self) -> None:
        self.told: list[tuple[Any, ...]] = []

    def __call__(self, *arguments: Any, **named: Any) -> Notes:
        self.told.append(("made", *arguments, *named.values()))
        return self

    def add_scalar(self, name: str, value: float, step: int) -> None:
        self.told.append((name, value, step))

    def log(self, values: Mapping[str, float], step: int) -> None:
        self.told += [(name, value, step) for name, value in values.items()]

    def close(self) -> None:
        self.told.append(("closed",))

    finish = close


@pytest.fixture(params=["tensorboard", "wandb"])
def service(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> tuple[str, Notes]:
    notes = Notes()
    modules: dict[str, Any] = {
        "torch.utils.tensorboard": SimpleNamespace(SummaryWriter=notes),
        "wandb": SimpleNamespace(init=notes),
    }
    for name, names in modules.items():
        module = ModuleType(name)
        vars(module).update(vars(names))
        monkeypatch.setitem(sys.modules, name, module)
    return request.param, notes


def test_losses_and_validations_are_told_by_the_step_they_belong_to(service: tuple[str, Notes]) -> None:
    kind, notes = service
    with ProgressLog(quiet=True, tracker=make_tracker(kind, WEIGHTS, {"lr": 0.1})) as log:
        log.update(0.1, 5, 80, {"quality": 0.5})
        log.validated(6, {"right": 0.25}, "10 %", "right 25 %")
    made, *rest = notes.told
    if kind == "tensorboard":
        assert made == ("made", str(Path("out/net-tensorboard")))
    else:
        assert made == ("made", "mpgrasp", "net", {"lr": 0.1})
    assert rest == [("loss/quality", 0.5, 5), ("validation/right", 0.25, 6), ("closed",)]


def test_without_a_tracker_nothing_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    with ProgressLog() as log:
        log.validated(6, {"right": 0.25}, "10 %", "right 25 %")
    assert capsys.readouterr().err == "10 % validation  right 25 %\n"


@pytest.mark.parametrize("kind", ["tensorboard", "wandb"])
def test_what_is_not_installed_or_does_not_start_is_one_error(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = "torch.utils.tensorboard" if kind == "tensorboard" else kind
    monkeypatch.setitem(sys.modules, name, None)  # as if it were not there
    with pytest.raises(ConfigError, match=f"{kind} is not installed .*; allowed: pip install {kind}"):
        make_tracker(kind, WEIGHTS, {})

    def fails(*arguments: Any, **named: Any) -> None:
        raise RuntimeError("no login")

    broken = ModuleType(name)
    vars(broken).update(SummaryWriter=fails, init=fails)
    monkeypatch.setitem(sys.modules, name, broken)
    with pytest.raises(ConfigError, match=rf"{kind} does not start \(RuntimeError: no login\)"):
        make_tracker(kind, WEIGHTS, {})


def test_another_one_is_refused() -> None:
    with pytest.raises(ConfigError, match="unknown tracker; got 'mlflow'; allowed: tensorboard, wandb"):
        make_tracker("mlflow", WEIGHTS, {})
