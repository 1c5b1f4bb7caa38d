"""Laws of `mpgrasp.evaluate`: rates over a dataset for any detector, and nothing is lost or left unsaid."""

from __future__ import annotations

import csv
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from toy_datasets import write_cornell, write_frames, write_jacquard, write_multi_object
from toy_shards import write_shards
from toy_training import SMALL

from mpgrasp.datasets.cornell import Cornell
from mpgrasp.detectors import make_detector
from mpgrasp.detectors.networks.description import read_card
from mpgrasp.evaluate.__main__ import main
from mpgrasp.evaluate.predict import grasps, predict, square
from mpgrasp.evaluate.scores import ImageScore, Rate, paired_tests, rates, score
from mpgrasp.geometry import line_angle_difference


@pytest.mark.parametrize("kind", ["cornell", "jacquard"])
def test_boxes_are_grasped_by_who_can_and_the_results_say_so(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write = write_cornell if kind == "cornell" else write_jacquard
    folder, out = write(tmp_path / "some data"), tmp_path / "out"
    words = [kind, str(folder), "--detector", "heuristic", "--out", str(out)]
    assert main(words) == 0
    said = capsys.readouterr().out
    unit = "m and mm" if kind == "cornell" else "m"
    assert f"3 images, depth stored in {unit}; no image was left out" in said
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
    seen = square(image, 300.0).image
    assert seen.depth.shape == (300, 300)
    assert np.isfinite(seen.depth).all()
    whole = square(image).image
    assert whole.depth.shape == (350, 350)
    assert whole.rectangles[0].width_px == pytest.approx(60 * 350 / 480, rel=1e-4)


def test_a_grasp_is_told_in_pixels_of_the_image(tmp_path: Path) -> None:
    image = square(Cornell(write_cornell(tmp_path / "c")).read("0101"), 300.0).image
    (best, *_) = grasps(predict(make_detector("heuristic"), image), image.depth.shape[0], 5)
    (label,) = image.rectangles
    assert np.hypot(best.u - label.u, best.v - label.v) < 3
    assert best.jaw_px == pytest.approx(best.width_px / 2)
    assert best.width_px > 40


def test_a_best_grasp_on_a_false_match_in_a_corner_is_counted_as_at_the_border(tmp_path: Path) -> None:
    whole = square(Cornell(write_cornell(tmp_path / "c")).read("0101"), 300.0)
    image = whole.image
    depth = np.full_like(image.depth, np.median(image.depth))
    depth += np.random.default_rng(0).normal(0, 3e-4, depth.shape).astype(np.float32)
    depth[4:24, 4:34] -= np.float32(0.1)
    (seen,) = score(
        {"heuristic": make_detector("heuristic")}, replace(whole, image=replace(image, depth=depth))
    )
    assert seen.border
    assert not seen.top1
    (clean,) = score({"heuristic": make_detector("heuristic")}, whole)
    assert not clean.border


def test_frames_without_labels_are_looked_at_and_count_for_no_rate(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, out = write_frames(tmp_path / "frames"), tmp_path / "out"
    words = ["frames", str(folder), "--detector", "heuristic", "--focal", "600", "--out", str(out)]
    assert main(words) == 0
    assert "2 images have no label" in capsys.readouterr().out
    told = json.loads((out / "evaluation.json").read_text())["rates"]["heuristic"]
    assert (told["top1"]["count"], told["top1"]["n"], told["border"]["n"]) == (1, 1, 3)
    with (out / "images.csv").open() as file:
        rows = {row["image"]: row for row in csv.DictReader(file)}
    # the boxes lie in the middle of images of 400 x 300 px, and are grasped across
    for name, angle in (("a", 0.0), ("b", 0.4), ("more/c", 0.8)):
        assert np.hypot(float(rows[name]["u"]) - 199.5, float(rows[name]["v"]) - 149.5) < 6
        turn = float(line_angle_difference(float(rows[name]["angle"]), angle + np.pi / 2))
        assert np.rad2deg(turn) < 8
        assert 35 < float(rows[name]["width_px"]) < 90


def test_all_kinds_of_datasets_are_played_by_one_command(tmp_path: Path) -> None:
    multi = write_multi_object(tmp_path / "multi")
    assert main(["multi", str(multi), "--detector", "heuristic", "--out", str(tmp_path / "m")]) == 0
    assert (
        json.loads((tmp_path / "m" / "evaluation.json").read_text())["rates"]["heuristic"]["top1"]["count"]
        == 3
    )
    made = write_shards(tmp_path / "set", shards=1, images=3)
    assert main(["synthetic", str(made), "--detector", "heuristic", "--out", str(tmp_path / "s")]) == 0
    page = (tmp_path / "s" / "report.html").read_text()
    assert page.count("data:image/png;base64,") >= 1
    assert "http" not in page.replace("http-equiv", "")


def test_folds_are_told_and_are_the_same_for_every_detector(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, out = write_cornell(tmp_path / "c", 6), tmp_path / "out"
    words = ["cornell", str(folder), "--split", "ow", "--folds", "3", "--detector", "heuristic"]
    assert main([*words, "--out", str(out)]) == 0
    assert "100.0 ± 0.0" in capsys.readouterr().out
    folds = json.loads((out / "folds.json").read_text())
    assert sorted(folds.values()) == [1, 1, 2, 2, 3, 3]
    reader = Cornell(folder)
    assert len({(reader.object_of(name), fold) for name, fold in folds.items()}) == 3


def test_folds_are_of_the_first_images_and_a_broken_one_is_not_made_up_for(tmp_path: Path) -> None:
    folder, out = write_cornell(tmp_path / "c", 6), tmp_path / "out"
    (folder / "01" / "pcd0101cpos.txt").unlink()
    words = [
        "cornell",
        str(folder),
        "--split",
        "iw",
        "--folds",
        "2",
        "--limit",
        "4",
        "--detector",
        "heuristic",
    ]
    assert main([*words, "--out", str(out)]) == 0
    assert sorted(json.loads((out / "folds.json").read_text())) == ["0100", "0102", "0103"]


def test_a_fold_is_tested_by_what_was_trained_on_the_others_and_a_second_command_trains_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, out = write_cornell(tmp_path / "c", 4), tmp_path / "out"
    words = [
        "cornell",
        str(folder),
        "--train",
        "--split",
        "iw",
        "--folds",
        "2",
        "--fold",
        "2",
        "--out",
        str(out),
    ]
    words += ["--epochs", "2", "--batch", "2", "--threads", "1", "--precision", "float32", "--side", "300"]
    words += ["--settings", json.dumps(SMALL)]
    assert main(words) == 0
    assert "98.86" in capsys.readouterr().out, "the paper's row stands beside"
    (weights,) = (out / "folds").glob("*.safetensors")
    assert weights.stem == "dhrnet-d-iw-2-of-2"
    told = json.loads((out / "evaluation.json").read_text())
    assert told["rates"]["dhrnet"]["top1"]["n"] == 2
    card = read_card(weights)["card"]
    assert card["training_images"] + round(card["validation"].get("n", 0)) <= 2
    assert {row["name"] for row in card["data"]} == {"iw-1-of-2"}
    before = weights.stat().st_mtime_ns
    assert main(words) == 0
    assert weights.stat().st_mtime_ns == before
    assert main([*words, "--level"]) == 2
    assert "holds other training images" in capsys.readouterr().err


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
        (["--train"], "--train without --split"),
        (["--train", "--split", "iw"], "--train without --out"),
        (["--train", "--split", "iw", "--out", "o", "--fold", "6"], "unusable --fold; got 6"),
        (["--fold", "2"], "--fold without --train; got 2"),
        (["--lr", "0.01"], "--lr without --train; got 0.01"),
        (["--folds", "4"], "--folds without --split; got 4"),
        (["--focal", "500"], "--focal without frames; got 500"),
        (["--split", "ow", "--folds", "4"], "unusable number of folds of 1 objects"),
        (["--settings", "[1]"], "--settings is no JSON object"),
        (["--settings", '{"width": 8}'], "--settings without --train"),
        (["--channels", "rgb"], "dhrnet reads depth alone; got '--channels rgb'"),
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
