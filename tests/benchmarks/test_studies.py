"""Laws of the studies: what their figures of merit mean, what is kept and published, and bad input."""

from __future__ import annotations

import csv
import importlib
import json
import subprocess
import sys
from math import comb
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
from toy_shards import write_shards

from mpgrasp.depth import DepthFrame, crop_resize, inpaint
from mpgrasp.exceptions import ConfigError, OutputError
from mpgrasp.grasp import Grasp, GraspMap
from mpgrasp.height_map import HeightMap

NAMES = (
    "ablation", "controller_factors", "held_out", "run_time", "same_bits", "singular_film", "thickness",
)  # fmt: skip
BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
TINY = {"width": 8, "stem_width": 8, "head_width": 8, "blocks": 1, "fine_head": False}


def module(name: str) -> Any:
    return importlib.import_module(name)


@pytest.fixture(scope="module")
def study() -> ModuleType:
    return importlib.import_module("study")


@pytest.mark.parametrize(("only_a", "only_b", "both"), [(8, 2, 5), (0, 6, 1), (3, 3, 0), (0, 0, 4)])
def test_mcnemar_asks_how_likely_so_uneven_a_split_of_the_differing_answers_is(
    study: ModuleType, only_a: int, only_b: int, both: int
) -> None:
    a = [True] * only_a + [False] * only_b + [True] * both
    b = [False] * only_a + [True] * only_b + [True] * both
    (row,) = study.paired({"a": a, "b": b})
    n, few = only_a + only_b, min(only_a, only_b)
    tail = sum(comb(n, k) for k in range(few + 1)) / 2**n
    assert (row["only_a"], row["only_b"], row["n"]) == (only_a, only_b, n + both)
    assert row["p"] == pytest.approx(min(1.0, 2 * tail))
    (mirrored,) = study.paired({"b": b, "a": a})
    assert mirrored["p"] == row["p"]


def test_every_pair_is_compared_and_unequal_numbers_of_answers_are_refused(study: ModuleType) -> None:
    answers = {name: [True, False] for name in "abcd"}
    assert len(study.paired(answers)) == 6
    with pytest.raises(ValueError, match="argument"):
        study.paired({"a": [True], "b": [True, False]})


def test_tests_are_corrected_over_all_of_a_study(study: ModuleType) -> None:
    answers = {"a": [True] * 8, "b": [False] * 8, "c": [True] * 8}  # p is 2 / 2^8, 1 and 2 / 2^8
    tests = [{"metric": metric, **row} for metric in ("hit", "lifted") for row in study.paired(answers)]
    found = study.corrected(tests)
    assert [{k: v for k, v in row.items() if k != "p_holm"} for row in found] == tests
    assert [row["p_holm"] for row in found] == pytest.approx([6 * 2 / 2**8, 1.0, 6 * 2 / 2**8] * 2)
    assert study.corrected([]) == []


def test_a_kept_result_is_not_made_again_and_other_settings_are_refused(
    study: ModuleType, tmp_path: Path
) -> None:
    made = []

    def make() -> dict[str, Any]:
        made.append(1)
        return {"value": np.float64(0.25)}

    file = tmp_path / "runs" / "a.json"
    assert study.kept(file, {"lr": 1e-3, "sizes": (1, 2)}, make) == {"value": 0.25}
    assert study.kept(file, {"lr": 1e-3, "sizes": (1, 2)}, make) == {"value": 0.25}
    assert len(made) == 1
    with pytest.raises(ConfigError, match="other settings"):
        study.kept(file, {"lr": 1e-4, "sizes": (1, 2)}, make)
    file.write_text("{")
    with pytest.raises(OutputError):
        study.kept(file, {"lr": 1e-3, "sizes": (1, 2)}, make)


def test_published_tables_have_one_column_per_number(study: ModuleType, tmp_path: Path) -> None:
    rows = [{"name": "a", "hit": {"rate": 0.5, "n": 2}}, {"name": "b", "more": 1}]
    picture, _ = study.figure(2)
    study.publish(tmp_path / "x", "x", {"command": "c"}, {"rows": rows}, rows, picture)
    assert json.loads((tmp_path / "x" / "x.json").read_text())["rows"] == rows
    with (tmp_path / "x" / "x.csv").open() as file:
        table = list(csv.DictReader(file))
    assert table[0] == {"name": "a", "hit_rate": "0.5", "hit_n": "2", "more": ""}
    assert (tmp_path / "x" / "x.png").read_bytes().startswith(b"\x89PNG")
    assert {p.name for p in (tmp_path / "x").iterdir()} == {"run.json", "x.json", "x.csv", "x.png"}


# --- calibration and threshold -----------------------------------------------------------------


def trial(quality: float, lifted: bool, scene: int = 0, **more: Any) -> Any:
    known = {
        "image": 0,
        "camera_height": 0.4,
        "thin": False,
        "stacked": False,
        "hit": True,
        "rectangle": True,
    }
    judged = {"graspable": True, "outcome": "success" if lifted else "missed"}
    return module("single_view").Trial(
        detector="d", quality=quality, peak_height=quality, lifted=lifted, scene=scene,
        **{**known, **judged, **more},
    )  # fmt: skip


def test_a_detector_that_claims_what_it_achieves_has_no_calibration_error() -> None:
    study = module("calibration")
    lines = [trial(q, k < 20 * q) for q in (0.05, 0.25, 0.75, 0.95) for k in range(20)]
    found = study.calibration(lines)
    assert found["ece"] == pytest.approx(0, abs=1e-9)
    assert found["brier"] == pytest.approx(np.mean([q * (1 - q) for q in (0.05, 0.25, 0.75, 0.95)]))
    assert sum(b["n"] for b in found["bins"]) == found["n"] == 80


def test_overconfidence_is_the_calibration_error_and_no_grasp_counts_for_nothing() -> None:
    study = module("calibration")
    lines = [trial(1.0, k % 2 == 0) for k in range(10)] + [trial(0.0, False, outcome="no_grasp")] * 5
    found = study.calibration(lines)
    assert (found["n"], found["ece"], found["brier"]) == (10, 0.5, 0.5)
    assert found["brier_constant"] == 0.25
    assert study.calibration(lines[10:]) == {"n": 0, "bins": []}


def test_the_threshold_parts_right_peaks_from_false_ones() -> None:
    study = module("calibration")
    lines = [trial(0.795, True, scene=k) for k in range(60)]
    lines += [trial(0.305, False, scene=k, graspable=False) for k in range(40)]
    chosen = study.choose_threshold(lines, np.random.default_rng(0))
    assert chosen["threshold"] == pytest.approx(0.31)
    assert chosen["youden"] == chosen["found"]["rate"] == 1
    assert chosen["false_peaks"]["count"] == 0
    assert chosen["careful"]["threshold"] == pytest.approx(0.31)
    assert chosen["low"] <= chosen["threshold"] <= chosen["high"]
    too_few = study.choose_threshold(lines[:3], np.random.default_rng(0))
    assert too_few["careful"] is None


def test_the_chosen_threshold_is_the_best_of_all_by_counting_one_by_one() -> None:
    study = module("calibration")
    rng = np.random.default_rng(3)
    lines = [
        trial(float(q), bool(rng.random() < q), scene=k // 4, graspable=bool(rng.random() < 0.9))
        for k, q in enumerate(rng.random(200))
    ]
    chosen = study.choose_threshold(lines, np.random.default_rng(0))

    def youden(threshold: float) -> float:
        right = [line.peak_height > threshold for line in lines if line.lifted]
        false = [line.peak_height > threshold for line in lines if not line.lifted]
        return float(np.mean(right) - np.mean(false))

    best = max(np.linspace(0, 1, 101), key=youden)
    assert chosen["threshold"] == pytest.approx(best)
    assert chosen["youden"] == pytest.approx(youden(best))
    assert chosen["low"] < chosen["high"]
    falling = [point["false_peaks"]["count"] for point in chosen["curve"]]
    assert falling == sorted(falling, reverse=True)


# --- held-out scenes ----------------------------------------------------------------------------


def stack(positions: list[tuple[float, float, float]]) -> Any:
    """Boxes of 4 cm in a scene without noise."""
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 0.1])
    for k, position in enumerate(positions):
        body = spec.worldbody.add_body(name=f"box{k}", pos=list(position))
        body.add_freejoint()
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.02, 0.02, 0.02])
    model = spec.compile()
    names = tuple(f"box{k}" for k in range(len(positions)))
    return SimpleNamespace(model=model, objects=names, data=lambda: mujoco.MjData(model))


@pytest.mark.parametrize(
    ("positions", "stacked"),
    [
        ([(0, 0, 0.02)], False),
        ([(0, 0, 0.02), (0.1, 0, 0.02)], False),
        ([(0, 0, 0.02), (0.0399, 0, 0.02)], False),
        ([(0, 0, 0.02), (0.005, 0, 0.0599)], True),
    ],
)
def test_a_stack_is_an_object_that_lies_on_another(
    positions: list[tuple[float, float, float]], stacked: bool
) -> None:
    assert module("single_view").is_stacked(stack(positions)) is stacked


class Points:
    """Grasps pixel (20, 30) at a quality, along the image's rows."""

    name = "points"

    def __init__(self, quality: float) -> None:
        self.quality = quality

    def reset(self, truth: HeightMap | None) -> None:
        assert truth is None

    def predict(self, frame: DepthFrame) -> GraspMap:
        image = crop_resize(frame, frame.depth.shape[0], frame.depth.shape[0])
        quality = np.zeros_like(image.depth)
        quality[19:22, 29:32] = 0.9 * self.quality
        quality[20, 30] = self.quality
        return GraspMap(
            quality=quality,
            angle=np.zeros_like(quality),
            width=np.full_like(quality, 12),
            depth=inpaint(image.depth),
            intrinsics=image.intrinsics,
            T_world_camera=image.T_world_camera,
        )


class Rig:
    """Lifts whatever is grasped with more than half the quality."""

    def __init__(self, scene: object) -> None:
        pass

    def attempt(self, grasp: Grasp) -> SimpleNamespace:
        return SimpleNamespace(outcome="success" if grasp.quality > 0.5 else "slipped")


@pytest.fixture
def held_out(monkeypatch: pytest.MonkeyPatch, study: ModuleType) -> Any:
    found, view = module("held_out"), module("single_view")
    monkeypatch.setattr(view, "make_scene", lambda seed, index: (stack([(0, 0, 0.02)]), None))
    monkeypatch.setattr(view, "LiftRig", Rig)
    made = {"sure": 0.8, "shy": 0.3, "blind": 0.0}
    monkeypatch.setattr(study, "load_detector", lambda name, weights: Points(made[name]))
    return found


def test_every_detector_is_judged_on_the_same_views_and_its_grasps_are_executed(
    held_out: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_shards(tmp_path / "data", shards=1, images=6, size=224)
    command = ["--data", str(tmp_path / "data"), "--detector", "sure,shy,blind", "--workers", "1"]
    assert held_out.main([*command, "--scenes", "5", "--out", str(tmp_path / "out")]) == 0
    results = json.loads((tmp_path / "out" / "held-out.json").read_text())
    assert (results["scenes"], results["views"]) == (5, 5)
    lifted = {r["detector"]: r["lifted"]["count"] for r in results["accuracy"] if r["group"] == "all"}
    assert lifted == {"sure": 5, "shy": 0, "blind": 0}
    (test,) = [
        row
        for row in results["mcnemar"]
        if (row["metric"], row["group"], row["a"], row["b"]) == ("lifted", "all", "sure", "shy")
    ]
    assert (test["only_a"], test["only_b"]) == (5, 0)
    assert test["p"] == pytest.approx(2 / 2**5)
    assert test["p"] < test["p_holm"] <= len(results["mcnemar"]) * test["p"]
    assert results["calibration"]["sure"]["ece"] == pytest.approx(0.2)
    assert results["calibration"]["shy"]["brier"] == pytest.approx(0.09)
    assert results["calibration"]["blind"]["n"] == 0
    with (tmp_path / "out" / "held-out.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert len(lines) == 15
    assert {line["outcome"] for line in lines if line["detector"] == "blind"} == {"no_grasp"}
    assert "threshold" in capsys.readouterr().out


def test_groups_part_the_views(held_out: Any) -> None:
    low, high = held_out.CAMERA_HEIGHT
    lines = [
        trial(0.9, True, thin=k % 2 == 0, camera_height=float(h))
        for k, h in enumerate(np.linspace(low, high, 31))
    ] + [trial(0.9, True, thin=True, camera_height=low, graspable=False)]
    counts = {row["group"]: row["n"] for row in held_out.accuracy(lines)}
    assert counts["thin"] + counts["thick"] == counts["low"] + counts["mid"] + counts["high"] == 31
    assert counts["low"] == counts["mid"] == 10
    assert counts["all"] == 31
    assert counts["stacked"] == 0


# --- short trainings ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def shards(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_shards(tmp_path_factory.mktemp("shards"), shards=3, images=8)


@pytest.fixture
def ablation(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The study with networks that learn in seconds, on images of 64 px."""
    found, short = module("ablation"), module("short_training")
    variants = tuple(
        short.Variant(label=f"d {head}", name="dhrnet", settings=TINY | {"head": head})
        for head in ("all", "highest")
    )
    monkeypatch.setattr(found, "STUDIES", {"fusion": variants})
    return found


def ablate(ablation: Any, shards: Path, out: Path, *more: str) -> int:
    data = ["--data", str(shards), "--held-out", str(shards), "--images", "18", "--judged", "6"]
    return int(
        ablation.main(
            ["fusion", *data, "--epochs", "2", "--batch", "6", "--threads", "1", "--out", str(out), *more]
        )
    )


def test_only_the_first_shards_that_are_needed_are_read(shards: Path, tmp_path: Path) -> None:
    short = module("short_training")
    dataset = short.first_images(shards, 12, tmp_path / "links", colour=False)
    assert len(dataset) == 16
    assert dataset.training.tolist() == list(range(12))
    with pytest.raises(ConfigError, match="not enough images"):
        short.first_images(shards, 25, tmp_path / "more", colour=False)


def test_an_interrupted_ablation_goes_on_and_gives_what_it_would_have_given(
    ablation: Any, shards: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert ablate(ablation, shards, tmp_path) == 0
    assert "estimate: 2 runs" in capsys.readouterr().out
    results = json.loads((tmp_path / "ablation-fusion.json").read_text())
    assert [run["label"] for run in results["runs"]] == ["d all", "d highest"]
    assert all([p["epoch"] for p in run["curve"]] == [1, 2] for run in results["runs"])
    assert {row["n"] for row in results["mcnemar"]} == {6}
    assert all(row["p"] <= row["p_holm"] <= 1 for row in results["mcnemar"])
    lost = tmp_path / "runs" / "d-highest-0.json"
    first = json.loads(lost.read_text())["result"]
    lost.unlink()
    assert ablate(ablation, shards, tmp_path) == 0
    printed = capsys.readouterr().out
    assert "estimate: 1 runs" in printed
    assert "d all" not in printed.split("in all")[0]
    again = json.loads(lost.read_text())["result"]
    assert {k: v for k, v in again.items() if k != "minutes"} == {
        k: v for k, v in first.items() if k != "minutes"
    }
    assert ablate(ablation, shards, tmp_path, "--lr", "1e-4") == 2
    assert "other settings" in capsys.readouterr().err


def test_published_variants_are_networks_that_can_be_built() -> None:
    from mpgrasp.detectors.networks.registry import build_network

    for variants in module("ablation").STUDIES.values():
        assert len({v.label for v in variants}) == len(variants)
        for variant in {v.name + str(v.settings): v for v in variants}.values():
            build_network(variant.name, variant.settings)


# --- run time -----------------------------------------------------------------------------------


def test_every_network_is_timed_once_a_round_on_every_runtime(monkeypatch: pytest.MonkeyPatch) -> None:
    from mpgrasp.detectors.networks.registry import build_network
    from mpgrasp.detectors.networks.weights import NetworkWeights

    timed, run_time = module("timed_network"), module("run_time")
    settings = TINY | {"channels": 1}
    weights = NetworkWeights(
        name="dhrnet", network=build_network("dhrnet", settings).eval(), settings=settings
    )
    entries = [timed.make_entry("tiny", weights, runtime) for runtime in ("torch plain", "torch")]
    image = np.random.default_rng(0).random((1, 224, 224), np.float32)
    assert np.allclose(entries[0].timed(image), entries[1].timed(image), atol=1e-4)
    images = run_time.frames(1, "auto", 0)
    timed.time_all(entries, images, 3, np.random.default_rng(0))
    sizes = {"tiny": timed.network_size(weights, False)}
    assert sizes["tiny"]["weights"] == "random"
    rows = run_time.summarise(entries, sizes)
    assert [len(e.predict) for e in entries] == [len(e.alone) for e in entries] == [3, 3]
    for row in rows:
        assert 0 < row["network_ms"]["median"] < row["predict_ms"]["median"]
        assert row["predict_ms"]["p5"] <= row["predict_ms"]["median"] <= row["predict_ms"]["p95"]
        assert row["first_call_s"]["cold"] > 0
    assert rows[0]["speed_up"] == {"predict": 1.0, "network": 1.0}
    ratio = rows[0]["network_ms"]["median"] / rows[1]["network_ms"]["median"]
    assert rows[1]["speed_up"]["network"] == pytest.approx(ratio)
    assert len(run_time.table(rows).splitlines()) == 3
    run_time.draw(rows)


# --- command lines ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "command", "message"),
    [
        ("ablation", [], "study"),
        ("ablation", ["colours"], "invalid choice"),
        ("ablation", ["fusion", "--images", "0"], "--images: unusable number"),
        ("ablation", ["fusion", "--seeds", "0"], "seeds"),
        ("ablation", ["architecture", "--data", "/nowhere"], "not enough images"),
        ("ablation", ["architecture", "--out", "/dev/null/x"], "cannot be written"),
        ("held_out", ["--detector", "resnet"], "unknown detector"),
        ("held_out", ["--detector", "oracle", "--data", "/nowhere"], "no training images"),
        ("held_out", ["--workers", "0"], "workers"),
        ("held_out", ["--seed", "-1"], "--seed: unusable number; got '-1'"),
        ("run_time", ["--network", "resnet"], "unknown network"),
        ("run_time", ["--rounds", "0"], "rounds"),
        ("run_time", ["--seed", "-1"], "--seed: unusable number; got '-1'"),
    ],
)
def test_unusable_input_is_one_line_and_exit_code_2(
    name: str, command: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    where = [] if "--out" in command else ["--out", str(tmp_path)]
    assert module(name).main([*command, *where]) == 2
    error = capsys.readouterr().err
    assert error.startswith("mpgrasp: error: ")
    assert error.count("\n") == 1
    assert message in error


def test_help_loads_neither_torch_nor_matplotlib() -> None:
    code = f"""
import importlib, sys
sys.path.insert(0, {str(BENCHMARKS)!r})
for name in {NAMES!r}:
    try:
        importlib.import_module(name).main(["--help"])
    except SystemExit as end:
        assert end.code == 0, end.code
heavy = {{"torch", "matplotlib", "openvino"}} & sys.modules.keys()
assert not heavy, heavy
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_a_study_takes_a_network_with_weights_of_its_own(study: ModuleType, tmp_path: Path) -> None:
    from mpgrasp.detectors.networks.registry import default_weights

    mine = tmp_path / "mine.safetensors"
    mine.write_bytes(default_weights("ggcnn2").read_bytes())
    detectors, told = study.load_detectors(f"heuristic,ggcnn2,ggcnn2@{mine}")
    assert list(detectors) == ["heuristic", "ggcnn2", "ggcnn2@mine"]
    hashes = told["weights_sha256"]
    assert hashes["heuristic"] is None
    assert hashes["ggcnn2@mine"] == hashes["ggcnn2"] is not None
