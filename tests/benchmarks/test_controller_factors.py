"""Laws of the study of factors: the design, effects that are known, and episodes that are kept."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import controller_factors
import factor_episodes
import numpy as np
import pytest
from factor_episodes import FACTORS, Study, Task, config_of
from factorial import GENERATORS, LETTERS, alias_groups, design, interactions, main_effects

import mpgrasp
from mpgrasp.controllers.config import MVP, MVP_ROBUST
from mpgrasp.geometry import FloatArray

PLANTED = {"A": 30.0, "D": -12.0, "G": 5.0}
"""True effects of a simulated response; those of all other factors are 0."""


def simulated(rng: np.random.Generator, worlds: int, noise: float = 4.0) -> FloatArray:
    """A response (16, worlds) with `PLANTED` effects, which vary by world, and worlds of any level."""
    levels = design()
    response = rng.normal(50.0, 30.0, worlds) + rng.normal(0.0, noise, (16, worlds))
    for letter, effect in PLANTED.items():
        of_worlds = effect + rng.normal(0.0, 6.0, worlds)
        response += levels[:, LETTERS.index(letter), None] / 2 * of_worlds
    return np.asarray(response)


def test_every_factor_has_both_levels_equally_often_beside_both_levels_of_every_other() -> None:
    levels = design()
    assert levels.shape == (16, 8)
    assert np.array_equal(levels.T @ levels, 16 * np.eye(8))
    assert len({tuple(row) for row in levels.tolist()}) == 16
    assert (levels[0] == -1).all()
    for letter, parents in GENERATORS.items():
        product = np.prod([levels[:, LETTERS.index(parent)] for parent in parents], axis=0)
        assert np.array_equal(levels[:, LETTERS.index(letter)], product)


def test_the_resolution_is_four() -> None:
    # by definition: the shortest product of factors that is constant has four of them
    levels = design()
    words = [
        size for size in range(1, 9) for some in combinations(range(8), size)
        if abs(levels[:, some].prod(axis=1).sum()) == 16
    ]  # fmt: skip
    assert words == [4] * 14 + [8]


def test_interactions_of_two_factors_stand_in_seven_groups_of_four() -> None:
    groups = alias_groups()
    assert [len(group) for group in groups] == [4] * 7
    assert len({pair for group in groups for pair in group}) == 28
    assert ("AB", "CG", "DH", "EF") in groups


def test_a_planted_effect_is_found_and_nothing_else() -> None:
    found = {effect.name: effect for effect in main_effects(simulated(np.random.default_rng(1), 24))}
    for letter in LETTERS:
        effect, truth = found[letter], PLANTED.get(letter, 0.0)
        assert effect.n == 24
        assert effect.effect == pytest.approx(truth, abs=4.0)
        assert effect.low < effect.effect < effect.high
        assert (effect.p_holm < 0.05) is (letter in ("A", "D", "G"))
        assert effect.p <= effect.p_holm


def test_an_effect_is_the_difference_of_the_means_at_both_levels() -> None:
    response = simulated(np.random.default_rng(2), 5)
    for letter, effect in zip(LETTERS, main_effects(response), strict=True):
        high = design()[:, LETTERS.index(letter)] > 0
        assert effect.effect == pytest.approx(response[high].mean() - response[~high].mean())


def test_a_planted_interaction_shows_in_its_group_and_in_no_factor() -> None:
    levels, rng = design(), np.random.default_rng(3)
    planted = 10 * levels[:, [2]] * levels[:, [6]] + rng.normal(0.0, 1.0, (16, 12))  # C and G
    found = {effect.name: effect.effect for effect in interactions(planted)}
    assert found.pop("AB + CG + DH + EF") == pytest.approx(20.0, abs=1.0)
    assert max(map(abs, found.values())) < 1.0
    assert max(abs(effect.effect) for effect in main_effects(planted)) < 1.0


def test_intervals_hold_the_truth_about_as_often_as_they_claim() -> None:
    rng, held = np.random.default_rng(4), []
    for _ in range(12):
        for effect in main_effects(simulated(rng, 24)):
            held.append(effect.low <= PLANTED.get(effect.name, 0.0) <= effect.high)
    # 96 intervals: binomial, 3 standard errors are 0.07
    assert len(held) == 96
    assert np.mean(held) >= 0.88


def test_without_any_effect_the_test_rejects_seldom() -> None:
    rng = np.random.default_rng(5)
    p = [effect.p for _ in range(12) for effect in main_effects(rng.normal(size=(16, 8)))]
    assert np.mean(np.array(p) < 0.05) < 0.12


def test_the_first_run_is_mvp_and_each_factor_changes_it() -> None:
    assert config_of(0) == MVP
    assert len({str(config_of(run)) for run in range(16)}) == 16
    alike = [
        replace(MVP, grid=replace(MVP.grid, **factor.grid), **factor.controller) != MVP for factor in FACTORS
    ]
    assert all(alike)
    for run in range(16):
        config, high = config_of(run), dict(zip(LETTERS, (design()[run] > 0).tolist(), strict=True))
        assert (config.grid.prior_in_mean is MVP_ROBUST.grid.prior_in_mean) is high["A"]
        assert (config.grid.evidence == MVP_ROBUST.grid.evidence) is high["B"]
        assert (config.border == MVP_ROBUST.border) is high["C"] is config.grid.border_counts
        assert (config.gamma == MVP_ROBUST.gamma) is high["D"]
        assert (config.choice == "pool") is high["H"]


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> list[Task]:
    """Episodes that take no time: taking the prior out of the mean is all that helps."""
    played: list[Task] = []

    def play(study: Study, task: Task) -> dict[str, Any]:
        played.append(task)
        levels = dict(zip(LETTERS, design()[task.run].astype(int).tolist(), strict=True))
        success = int(levels["A"] > 0)
        ending = {"outcome": "success" if success else "reflex", "stop": 1 - success, "reflex": ""}
        moved = {"blind_drift_m": 0.1 - 0.05 * success, "min_singular_value": 0.01, "sim_time_s": 9.0}
        return {**task._asdict(), **levels, "success": success, "scene_seed": 1, **ending, **moved}

    monkeypatch.setattr(factor_episodes, "play", play)
    monkeypatch.setattr(controller_factors, "detector_of", lambda name: None)
    return played


def test_an_interrupted_study_goes_on_and_more_worlds_are_added(
    quick: list[Task], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["--thickness", "2,3", "--out", str(tmp_path)]
    assert controller_factors.main([*command, "--episodes", "2"]) == 0
    assert len(quick) == len(set(quick)) == 2 * 2 * 16
    printed = capsys.readouterr().out
    assert "A prior out of the mean" in printed
    assert "+100.0 [+100.0 to +100.0]" in printed
    effects = json.loads((tmp_path / "controller-factors.json").read_text())["effects"]
    (drift,) = (
        row for row in effects
        if (row["measure"], row["thickness_mm"], row["name"]) == ("blind_drift_m", 3, "A")
    )  # fmt: skip
    assert drift["effect"] == pytest.approx(-50.0)
    kept = tmp_path / "episodes.csv"
    whole = kept.read_text()
    kept.write_text(whole[:-20])  # killed while it wrote a line
    quick.clear()
    assert controller_factors.main([*command, "--episodes", "3"]) == 0
    assert len(quick) == 1 + 2 * 16
    with kept.open() as file:
        rows = list(csv.DictReader(file))
    assert len({(row["thickness_mm"], row["world"], row["run"]) for row in rows}) == len(rows) == 96
    assert {path.name for path in tmp_path.iterdir()} == {
        "run.json", "episodes.csv", "controller-factors.json", "controller-factors.csv",
        "controller-factors.png",
    }  # fmt: skip
    made_with = json.loads((tmp_path / "run.json").read_text())["made_with"]
    assert made_with["mpgrasp"] == mpgrasp.__version__
    quick.clear()
    assert controller_factors.main([*command, "--seed", "1"]) == 2
    assert not quick
    assert "other settings" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (["--episodes", "0"], "episodes"),
        (["--workers", "0"], "workers"),
        (["--thickness", "thin"], "unusable thickness"),
        (["--thickness", "-2"], "unusable thickness"),
        (["--seed", "-1"], "--seed: unusable number; got '-1'"),
        (["--detector", "resnet"], "unknown detector"),
    ],
)
def test_unusable_settings_of_the_study_are_one_line_and_exit_code_2(
    command: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert controller_factors.main([*command, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert message in error
    assert not (tmp_path / "out").exists()


def test_every_thickness_has_worlds_of_its_own_and_a_stick_of_that_thickness() -> None:
    suites = [factor_episodes.suite_of(thickness) for thickness in (1.5, 2.0)]
    assert len({suite.name for suite in suites}) == 2
    sticks = [suite.scene.objects[0] for suite in suites]
    assert [2 * stick.parts[0].size[2] for stick in sticks] == pytest.approx([0.0015, 0.002])  # type: ignore[union-attr]
