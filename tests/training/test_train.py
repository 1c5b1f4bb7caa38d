"""Laws of the command `train`: bad input is one line, and the card's command makes the same run."""

from __future__ import annotations

import argparse
import json
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from toy_training import SMALL

from mpgrasp.command_line import Parser
from mpgrasp.detectors.networks.description import read_card
from mpgrasp.exceptions import ConfigError
from mpgrasp.training import trainer as trainer_module
from mpgrasp.training.__main__ import main
from mpgrasp.training.train import add_arguments, command_line, config_from


@pytest.fixture(autouse=True)
def _one_thread() -> None:
    torch.set_num_threads(1)


WHOLE = ("batch", "images", "seed", "validation-images", "lift-images")


@pytest.mark.parametrize(
    ("option", "values"),
    [
        *((option, "0 -1 nan inf") for option in ("epochs", "minutes", "lr", "thin-weight", "beta")),
        *((option, "-1 nan inf") for option in ("weight-decay", "positive", "background")),
        ("validate-every", "0 nan"),
        ("average", "-0.1 1 nan"),
        *((option, "0 -1") for option in ("batch", "images")),
        *((option, "-1") for option in ("seed", "validation-images", "lift-images")),
    ],
)
def test_an_unusable_number_is_one_error_that_names_it_alone(option: str, values: str) -> None:
    parser = Parser(prog="train")
    add_arguments(parser)
    name = option.replace("-", "_")
    for value in values.split():
        with pytest.raises(ConfigError, match=f"--{option}: unusable number|unusable {name}"):
            config_from(parser.parse_args(["dhrnet", "--data", "d", f"--{option}", value]))
        # nor does the config itself take what a program gives it
        args = parser.parse_args(["dhrnet", "--data", "d"])
        setattr(args, name, int(value) if option in WHOLE else float(value))
        with pytest.raises(ConfigError) as caught:
            config_from(args)
        wrong, got, allowed = str(caught.value).split("; ")
        assert (wrong, got) == (f"unusable {name}", f"got {getattr(args, name)}")
        assert len(allowed) < 40


def test_a_training_writes_into_the_current_directory_unless_told_otherwise(
    shards: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(config: object, dataset: object, out: Path, *_: object, **__: object) -> None:
        asked.append(out)
        raise ConfigError("far enough")

    asked: list[Path] = []
    monkeypatch.setattr(trainer_module, "Trainer", stop)
    for out in ([], ["--out", "w.safetensors"]):
        assert main(["train", "dhrnet", "--data", str(shards), *out]) == 2
    assert asked == [Path("out/dhrnet.safetensors"), Path("w.safetensors")]


@pytest.mark.parametrize(
    "bad",
    [
        ["train", "resnet", "--data", "DATA"],
        ["train", "dhrnet", "--data", "nowhere"],
        ["train", "dhrnet", "--data", "DATA", "--epochs", "0"],
        ["train", "dhrnet", "--data", "DATA", "--settings", "{width}"],
        ["train", "dhrnet", "--data", "DATA", "--settings", '{"depth": 1}'],
        ["train", "dhrnet", "--data", "DATA", "--threads", "0"],
        ["train", "dhrnet", "--data", "DATA", "--lr", "much"],
        ["train", "dhrnet", "--data", "DATA", "--bogus"],
        ["bogus"],
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    bad: list[str], shards: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    argv = [str(shards) if word == "DATA" else word for word in bad]
    assert main([*argv, "--out", str(tmp_path / "w.safetensors")]) == 2
    error = capsys.readouterr().err
    assert error.startswith("mpgrasp: error: ")
    assert error.count("\n") == 1


def test_the_command_on_the_card_makes_the_same_run(tmp_path: Path) -> None:
    argv = ["dhrnet", "--data", "a b", "c", "--settings", '{"width": 8}', "--lr", "0.001", "--input", "rgbd"]
    argv += [
        "--no-augmentation",
        "--images",
        "50",
        "--minutes",
        "3",
        "--lift-images",
        "0",
        "--from",
        "w.safetensors",
    ]
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    args = parser.parse_args(argv)
    words = shlex.split(command_line(args))
    assert words[:4] == ["python", "-m", "mpgrasp.training", "train"]
    again = parser.parse_args(words[4:])
    assert vars(again) == vars(args)
    assert config_from(again) == config_from(args)


def test_the_command_trains_and_reports(shards: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "mpgrasp.training", "train", "dhrnet", "--data", str(shards), "--epochs"]
    command += ["1", "--batch", "16", "--settings", json.dumps(SMALL), "--threads", "1"]
    command += ["--lift-images", "0", "--validate-every", "1", "--curves", str(tmp_path / "curves"), "--out"]
    done = subprocess.run(
        [*command, str(tmp_path / "w.safetensors")], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["steps"] >= 1
    assert "validation" in done.stderr
    assert (tmp_path / "curves" / "w.csv").is_file()
    assert "--curves" in read_card(tmp_path / "w.safetensors")["card"]["command"]
    assert (tmp_path / "w.safetensors").is_file()
