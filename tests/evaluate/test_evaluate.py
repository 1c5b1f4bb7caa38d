"""Laws of `mpgrasp.evaluate`: rates over a dataset for any detector, and nothing is lost or left unsaid."""

from __future__ import annotations

import csv
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from toy_datasets import write_cornell, write_jacquard

from mpgrasp.datasets.cornell import Cornell
from mpgrasp.detectors import make_detector
from mpgrasp.evaluate.__main__ import main
from mpgrasp.evaluate.predict import grasps, square
from mpgrasp.evaluate.scores import ImageScore, Rate, paired_tests, rates, score


@pytest.mark.parametrize("kind", ["cornell", "jacquard"])
def test_boxes_are_grasped_by_who_can_and_the_results_say_so(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write = write_cornell if kind == "cornell" else write_jacquard
    folder, out = write(tmp_path / "some data"), tmp_path / "out"
    words = [kind, str(folder), "--detector", "heuristic", "--out", str(out)]
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "3 images; no image was left out" in said
    told = json.loads((out / "evaluation.json").read_text())
    assert told["rates"]["heuristic"]["top1"]["count"] == 3
    assert told["skipped"] == {}
    with (out / "images.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["top1"] for row in rows] == ["True"] * 3
    assert all(float(row["iou"]) > 0.25 for row in rows)
    assert not (out / "worst.png").exists(), "nothing went wrong"


def test_a_network_and_another_are_compared_and_the_worst_images_are_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = write_jacquard(tmp_path / "data", count=2)
    out = tmp_path / "out"
    assert main(["jacquard", str(folder), "--detector", "heuristic,ggcnn2", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "heuristic and ggcnn2: alone " in said
    (test,) = json.loads((out / "evaluation.json").read_text())["paired_tests"]
    assert (test["a"], test["b"]) == ("heuristic", "ggcnn2")


def test_a_square_around_the_labels_stays_in_the_image(tmp_path: Path) -> None:
    image = Cornell(write_cornell(tmp_path / "c")).read("0101")
    seen = square(image, 300.0)
    assert seen.depth.shape == (300, 300)
    assert np.isfinite(seen.depth).all()
    whole = square(image)
    assert whole.depth.shape == (350, 350)
    assert whole.rectangles[0].width_px == pytest.approx(60 * 350 / 480, rel=1e-4)


def test_a_grasp_is_told_in_pixels_of_the_image(tmp_path: Path) -> None:
    image = square(Cornell(write_cornell(tmp_path / "c")).read("0101"), 300.0)
    (best, *_) = grasps(make_detector("heuristic"), image, 5)
    (label,) = image.rectangles
    assert np.hypot(best.u - label.u, best.v - label.v) < 3
    assert best.jaw_px == pytest.approx(best.width_px / 2)
    assert best.width_px > 40


def test_a_best_grasp_on_a_false_match_in_a_corner_is_counted_as_at_the_border(tmp_path: Path) -> None:
    image = square(Cornell(write_cornell(tmp_path / "c")).read("0101"), 300.0)
    depth = np.full_like(image.depth, np.median(image.depth))
    depth += np.random.default_rng(0).normal(0, 3e-4, depth.shape).astype(np.float32)
    depth[4:24, 4:34] -= np.float32(0.1)
    (seen,) = score({"heuristic": make_detector("heuristic")}, replace(image, depth=depth))
    assert seen.border
    assert not seen.top1
    (clean,) = score({"heuristic": make_detector("heuristic")}, image)
    assert not clean.border


def row(detector: str, image: int, top1: bool, top5: bool = True) -> ImageScore:
    return ImageScore(
        image=str(image), object="o", detector=detector, top1=top1, top5=top5, iou=0.5, border=image < 2
    )


def test_rates_and_tests_are_those_of_the_rows() -> None:
    rows = [row("a", k, k < 9) for k in range(10)] + [row("b", k, k < 1) for k in range(10)]
    expected = {"top1": Rate(count=9, n=10), "top5": Rate(count=10, n=10), "border": Rate(count=2, n=10)}
    assert rates(rows, "a") == expected
    (test,) = paired_tests(rows)
    assert (test.a_alone, test.b_alone) == (8, 0)
    assert test.p_holm == pytest.approx(2 * 0.5**8)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--detector", "resnet"], "unknown detector; got 'resnet'"),
        (["--detector", "oracle"], "a dataset has no true shape to tell; got 'oracle'"),
        (["--detector", "ggcnn,ggcnn"], "unusable list of detectors"),
        (["--depth", "lidar"], "unknown depth of Jacquard"),
        (["--limit", "0"], "unusable number; got '0'"),
        (["--weights", "missing.pt"], "missing.pt"),
    ],
)
def test_what_cannot_be_evaluated_is_refused_in_a_line(
    more: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = write_jacquard(tmp_path / "data", count=1)
    assert main(["jacquard", str(folder), *more]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1


def test_a_folder_that_is_none_and_one_without_a_dataset_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["cornell", str(tmp_path / "nowhere")]) == 2
    assert main(["cornell", str(tmp_path)]) == 2
    err = capsys.readouterr().err
    assert "no such folder" in err
    assert "no Cornell dataset" in err


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_dataset_that_may_only_be_read_is_read(tmp_path: Path) -> None:
    folder = write_jacquard(tmp_path / "data", count=1)
    for path in (folder, *folder.rglob("*")):
        path.chmod(0o555 if path.is_dir() else 0o444)
    assert main(["jacquard", str(folder), "--detector", "heuristic"]) == 0
