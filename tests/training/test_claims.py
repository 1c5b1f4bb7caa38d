"""Laws of calibrating: what made the outcomes is found, and grasps are lifted in their own scenes."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors import safe_open
from scipy.special import expit, logit
from toy_networks import random_weights

from mpgrasp.depth import DepthFrame
from mpgrasp.detectors.detector import GraspDetector
from mpgrasp.detectors.network_detector import NetworkDetector
from mpgrasp.detectors.networks.calibration import Calibration
from mpgrasp.detectors.networks.description import read_card
from mpgrasp.detectors.networks.registry import default_weights
from mpgrasp.detectors.networks.weights import load_weights, save_weights
from mpgrasp.exceptions import ConfigError
from mpgrasp.grasp import Grasp, GraspMap
from mpgrasp.height_map import HeightMap
from mpgrasp.motion.lift_trial import LiftResult
from mpgrasp.outcome import Outcome
from mpgrasp.training import claims as measuring
from mpgrasp.training.__main__ import main
from mpgrasp.training.claims import Claim, claims, expected_error, fit, measured
from mpgrasp.training.data.views import stored_intrinsics
from mpgrasp.training.dataset import GraspDataset


def outcomes(truth: Calibration, n: int, seed: int = 0) -> list[Claim]:
    """Claims anywhere, that lift as often as a calibration says."""
    rng = np.random.default_rng(seed)
    quality = rng.beta(1.2, 1.2, n)
    lifts = rng.random(n) < expit(truth.slope * logit(quality) + truth.shift)
    return [Claim(quality=float(q), lifted=bool(up)) for q, up in zip(quality, lifts, strict=True)]


@pytest.mark.parametrize("truth", [Calibration(slope=0.6, shift=1.5), Calibration(slope=2.0, shift=-1.0)])
def test_the_calibration_that_made_the_outcomes_is_found(truth: Calibration) -> None:
    found = fit(outcomes(truth, 20_000))
    assert found.slope == pytest.approx(truth.slope, rel=0.06)
    assert found.shift == pytest.approx(truth.shift, abs=0.06)


def test_calibrated_claims_are_right_as_often_as_they_say() -> None:
    truth = Calibration(slope=0.5, shift=2.0)
    figures = measured(outcomes(truth, 4_000, seed=1), fit(outcomes(truth, 4_000)))
    assert figures["n"] == 4_000
    assert figures["ece_claimed"] > 0.2
    assert figures["ece_calibrated"] < 0.03


def test_the_expected_error_is_the_mean_gap_of_bins_by_their_numbers() -> None:
    quality = np.array([0.95, 0.95, 0.95, 0.15, 1.0])
    lifted = np.array([True, True, False, True, False])
    # the uppermost bin, with 1 in it: 3.85 claimed of 4, and 2 of 4 that lift; the other one: 0.15 and 1
    assert expected_error(quality, lifted) == pytest.approx((4 * abs(3.85 / 4 - 0.5) + 0.85) / 5)


def test_claims_that_say_nothing_keep_their_order() -> None:
    backwards = outcomes(Calibration(slope=1.0, shift=0.0), 500)
    turned = [Claim(quality=1 - claim.quality, lifted=claim.lifted) for claim in backwards]
    assert fit(turned).slope == pytest.approx(measuring.LEAST_SLOPE)


def test_too_few_of_either_ending_are_refused() -> None:
    with pytest.raises(ConfigError, match="19 that do not"):
        fit([Claim(quality=0.5, lifted=k >= 19) for k in range(100)])


class Pointer(GraspDetector):
    """Claims what it is told for the pixel it is told, one image after the other."""

    name = "pointer"

    def __init__(self, told: list[float]) -> None:
        self.told, self.seen = told, 0

    def reset(self, truth: HeightMap | None) -> None:
        raise AssertionError("a network knows nothing but images")

    def predict(self, frame: DepthFrame) -> GraspMap:
        quality = np.zeros_like(frame.depth)
        quality[20, 30] = self.told[self.seen]
        self.seen += 1
        flat = np.full_like(quality, 0.25)
        return GraspMap(
            quality=quality,
            angle=flat,
            width=np.full_like(quality, 20),
            depth=np.full_like(quality, 0.4),
            intrinsics=frame.intrinsics,
            T_world_camera=frame.T_world_camera,
        )


def played(monkeypatch: pytest.MonkeyPatch, lifts: list[bool]) -> list[tuple[tuple[int, int], Grasp]]:
    """Lifts that end as they are told; the list gets scene and grasp of each."""
    tried: list[tuple[tuple[int, int], Grasp]] = []

    class Rig:
        def __init__(self, scene: tuple[int, int]) -> None:
            self.scene = scene

        def attempt(self, grasp: Grasp) -> LiftResult:
            tried.append((self.scene, grasp))
            lifted = lifts[len(tried) - 1]
            return LiftResult(outcome=Outcome.SUCCESS if lifted else Outcome.SLIPPED, reason="")

    monkeypatch.setattr(measuring, "make_scene", lambda seed, index: ((seed, index), None))
    monkeypatch.setattr(measuring, "LiftRig", Rig)
    monkeypatch.setattr(measuring, "stored_intrinsics", lambda: stored_intrinsics().resize(64, 64))
    return tried


def test_the_best_grasp_of_each_image_is_tried_in_its_own_scene(
    shards: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dataset = GraspDataset([shards], holdout=0)
    tried = played(monkeypatch, [True, False])
    found = list(claims(Pointer([0.7, 0.0, 0.4]), dataset, range(3)))
    assert [claim.quality for claim in found] == pytest.approx([0.7, 0.4])
    assert [claim.lifted for claim in found] == [True, False]
    assert [scene for scene, _ in tried] == [dataset.scene(0), dataset.scene(2)]


def test_a_calibrated_file_tells_it_and_is_believed_unless_asked_not_to(
    shards: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    made = Calibration(slope=0.5, shift=1.0)
    monkeypatch.setattr(measuring, "claims", lambda *_: iter(outcomes(made, 3_000)))
    before, after = tmp_path / "before.safetensors", tmp_path / "after.safetensors"
    save_weights(before, random_weights("ggcnn2", {}))
    command = ["calibrate", "ggcnn2", "--weights", str(before), "--data", str(shards), "--out", str(after)]
    assert main(command) == 0
    assert "3000 grasps" in capsys.readouterr().out
    read = load_weights("ggcnn2", after)
    assert read.calibration is not None
    assert read.calibration.slope == pytest.approx(0.5, abs=0.05)
    assert read.card["calibration"]["n"] == 3_000
    with safe_open(before, framework="pt") as old, safe_open(after, framework="pt") as new:
        names = list(old.keys())
        assert names == list(new.keys())
        assert all((old.get_tensor(name) == new.get_tensor(name)).all() for name in names)
    assert load_weights("ggcnn2", before).calibration is None
    detectors = [NetworkDetector(load_weights("ggcnn2", file), runtime="torch") for file in (before, after)]
    depth = np.full((300, 300), 0.5, np.float32)
    depth[100:140, 120:200] = 0.46
    raw, calibrated = (detector.grasp_arrays(depth)[0] for detector in detectors)
    np.testing.assert_allclose(calibrated, read.calibration(raw), atol=1e-6)


def test_scenes_that_the_network_was_trained_on_are_refused(
    shards: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (about,) = GraspDataset([shards], holdout=0).description()
    weights = random_weights("ggcnn2", {})
    card = {"validation_data": [{"seed": about["seed"], "format": about["format"]}]}
    save_weights(tmp_path / "w.safetensors", replace(weights, card=card))
    command = ["calibrate", "ggcnn2", "--weights", str(tmp_path / "w.safetensors"), "--data", str(shards)]
    assert main(command) == 2
    assert "trained or chosen on" in capsys.readouterr().err


def test_the_documented_calibrations_are_those_that_ship() -> None:
    text = (Path(__file__).parents[2] / "docs" / "training.md").read_text(encoding="utf-8")
    table = text.split("## What a claim is worth")[1].split("\n## ")[0]
    rows = re.findall(r"^\| `(\w+)` \| (.+) \|$", table, re.MULTILINE)
    assert [name for name, _ in rows] == [
        "dhrnet", "ggcnn2", "tfgrasp", "ggcnn", "grconvnet", "pinto", "lenz",
    ]  # fmt: skip
    for name, cells in rows:
        told = read_card(default_weights(name))
        figures = told["card"]["calibration"]
        found = [*told["calibration"].values(), figures["ece_claimed"], figures["ece_calibrated"]]
        assert [f"{number:.2f}" for number in found] == cells.split(" | ")[:4]


def test_the_documented_errors_on_other_scenes_are_those_of_the_published_views() -> None:
    root = Path(__file__).parents[2]
    documented = dict(
        re.findall(
            r"^\| `(\w+)` (?:\| [\d.]+ ){4}\| ([\d.]+) \|$",
            (root / "docs" / "training.md").read_text(encoding="utf-8"),
            re.MULTILINE,
        )
    )
    published: dict[str, str] = {}
    for folder in ("held-out-grconvnet", "held-out-windows", "held-out"):
        study = root / "benchmarks" / "results" / folder / "held-out.json"
        calibration = json.loads(study.read_text(encoding="utf-8"))["calibration"]
        published |= {name: f"{found['ece']:.2f}" for name, found in calibration.items()}
    assert documented == published


def test_scenes_of_an_earlier_stage_of_the_training_are_refused(
    shards: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (about,) = GraspDataset([shards], holdout=0).description()
    first = {"data": [{"seed": about["seed"], "format": about["format"]}]}
    known = replace(random_weights("ggcnn2", {}), card={"start": {"card": first}})
    save_weights(tmp_path / "w.safetensors", known)
    command = ["calibrate", "ggcnn2", "--weights", str(tmp_path / "w.safetensors"), "--data", str(shards)]
    assert main(command) == 2
    assert "trained or chosen on" in capsys.readouterr().err


def test_weights_that_others_have_published_are_calibrated_too(
    shards: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        measuring, "claims", lambda *_: iter(outcomes(Calibration(slope=1.0, shift=0.5), 500))
    )
    torch.save(random_weights("ggcnn2", {}).network.state_dict(), tmp_path / "published.pt")
    command = ["calibrate", "ggcnn2", "--weights", str(tmp_path / "published.pt"), "--data", str(shards)]
    assert main([*command, "--out", str(tmp_path / "out.safetensors")]) == 0
    back = load_weights("ggcnn2", tmp_path / "out.safetensors")
    assert back.calibration is not None
    assert back.width_px == 150.0
