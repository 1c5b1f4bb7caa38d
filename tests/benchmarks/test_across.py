"""Laws of the study of single views against closed loop: an order is compared, and nothing but an order."""

from __future__ import annotations

import importlib
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from PIL import Image

RESULTS = Path(__file__).parents[2] / "benchmarks" / "results"
THICKNESS = RESULTS / "ladders" / "thickness"


@pytest.fixture(scope="module")
def across() -> ModuleType:
    return importlib.import_module("across")


def offline(folder: Path, rates: Mapping[str, float], views: int = 100, seed: int = 3) -> Path:
    """Results of held_out.py in which all three rates of a detector are the same."""
    folder.mkdir()
    rows = [
        {
            "detector": name,
            "group": group,
            "n": views,
            **{key: {"rate": rate} for key in ("lifted", "hit", "rectangle")},
        }
        for name, rate in rates.items()
        for group in ("thin", "all")
    ]
    (folder / "held-out.json").write_text(json.dumps({"accuracy": rows}))
    (folder / "run.json").write_text(json.dumps({"data": [{"name": "test", "seed": seed}]}))
    return folder


@pytest.fixture(scope="module")
def levels(across: ModuleType) -> dict[str, float]:
    """Thickness at which half of the grasps of each detector fail; less is better."""
    _, found = across.ladder([THICKNESS])
    return {one.method.detector: one.thresholds[1].level for one in found}


def test_tau_of_the_same_order_is_1_and_of_the_reverse_minus_1(across: ModuleType) -> None:
    rates, ease = np.array([0.2, 0.3, 0.5, 0.7, 0.9]), np.array([5.0, 4.0, 3.0, 2.0, 1.0])
    tau, low, high, p = across.kendall(rates, ease, np.random.default_rng(0))
    assert (tau, low, high) == pytest.approx((1.0, 1.0, 1.0))
    assert p == pytest.approx(2 / 120)  # of the 120 orders of five, this one and its reverse
    assert across.kendall(rates, ease[::-1], np.random.default_rng(0))[0] == pytest.approx(-1.0)


def test_tau_counts_pairs(across: ModuleType) -> None:
    rates, ease = np.array([0.1, 0.2, 0.3, 0.4]), np.array([4.0, 3.0, 1.0, 2.0])
    assert across.kendall(rates, ease, np.random.default_rng(0))[0] == pytest.approx((5 - 1) / 6)


@pytest.mark.parametrize(
    ("rate", "tau"),
    [(lambda level: 1 / level, 1.0), (lambda level: level / 10, -1.0)],
    ids=["same", "reverse"],
)
def test_an_order_that_agrees_with_a_ladder_puts_all_its_pairs_the_same_way(
    rate: Callable[[float], float], tau: float, across: ModuleType, levels: dict[str, float], tmp_path: Path
) -> None:
    folder = offline(tmp_path / "offline", {name: rate(level) for name, level in levels.items()})
    out = tmp_path / "out"
    assert across.main(["--offline", str(folder), "--ladder", str(THICKNESS), "--out", str(out)]) == 0
    found = json.loads((out / "across.json").read_text())
    assert found["views"] == 100
    assert {row["metric"] for row in found["agreement"]} == {"rectangle", "hit", "lifted"}
    for row in found["agreement"]:
        assert (row["ladder"], row["detectors"], row["tau"]) == ("thickness", len(levels), tau)
        assert row["alike"] == (row["told_apart"] if tau > 0 else 0)
        assert 0 < row["told_apart"] < len(levels) * (len(levels) - 1) / 2
    assert {row["detector"]: row["level"] for row in found["points"]} == pytest.approx(levels)
    assert Image.open(out / "across.png").width > 500
    assert len((out / "across.csv").read_text().splitlines()) == 1 + len(levels)
    assert json.loads((out / "run.json").read_text())["controller"] == "mppc_robust"


def test_rates_of_several_folders_are_put_together(across: ModuleType, tmp_path: Path) -> None:
    folders = [offline(tmp_path / "a", {"dhrnet": 0.5}), offline(tmp_path / "b", {"heuristic": 0.4})]
    rates, views = across.offline_rates(folders)
    assert views == 100
    assert {name: row["hit"]["rate"] for name, row in rates.items()} == {"dhrnet": 0.5, "heuristic": 0.4}


def test_what_cannot_be_compared_is_refused_in_one_line(
    across: ModuleType, levels: dict[str, float], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = offline(tmp_path / "whole", dict.fromkeys(levels, 0.5))
    few = offline(tmp_path / "few", {"dhrnet": 0.5})
    other = offline(tmp_path / "other", {"heuristic": 0.5}, views=99)
    elsewhere = offline(tmp_path / "elsewhere", {"heuristic": 0.5}, seed=4)
    torn = offline(tmp_path / "torn", {"heuristic": 0.5})
    (torn / "held-out.json").write_text("{}")
    cloth = RESULTS / "ladders" / "cloth"
    suites = RESULTS / "single-unseen-thin"
    for words, said in (
        (["--offline", str(tmp_path / "none")], "no rates of single views"),
        (["--offline", str(torn)], "no rates of single views: KeyError('accuracy')"),
        (["--offline", f"{whole},{other}"], "folders of other views; got [99, 100]"),
        (["--offline", f"{whole},{elsewhere}"], "folders of other views; got [100]"),
        (["--offline", str(few), "--ladder", str(THICKNESS)], "too few detectors with both; got 1"),
        (["--offline", str(whole), "--ladder", f"{THICKNESS},{cloth}"], "not a run of this ladder"),
        (["--offline", str(whole), "--ladder", str(suites)], "not a run of this ladder"),
        (["--offline", str(whole), "--ladder", str(tmp_path / "none")], "no run"),
    ):
        assert across.main([*words, "--out", str(tmp_path / "out")]) == 2
        error = capsys.readouterr().err
        assert said in error
        assert error.count("\n") == 1
