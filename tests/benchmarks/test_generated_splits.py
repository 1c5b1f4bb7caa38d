"""Laws of the study of splits: every image is tested once by a network that has not seen it."""

from __future__ import annotations

import csv
import importlib
import json
from pathlib import Path
from types import ModuleType

import pytest
from toy_shards import write_shards


@pytest.fixture(scope="module")
def splits() -> ModuleType:
    return importlib.import_module("generated_splits")


def test_rates_are_of_all_images_and_the_spread_is_of_folds(splits: ModuleType) -> None:
    images = {str(k): (k < 6, k < 8, 1 + k // 5) for k in range(10)}  # fold 1 all right, of fold 2 one
    row = splits.row_of("dhrnet", "d", "iw", images)
    assert (row["best"]["count"], row["one_of_five"]["count"], row["best"]["n"]) == (6, 8, 10)
    assert row["fold_mean"] == pytest.approx((1.0 + 0.2) / 2)
    assert row["fold_deviation"] == pytest.approx(0.8 / 2**0.5)


def test_networks_are_tested_against_the_reference_and_its_inputs_among_themselves(
    splits: ModuleType,
) -> None:
    right = {str(k): (True, True, 1) for k in range(8)}
    wrong = {str(k): (False, True, 1) for k in range(8)}
    cells = {
        ("iw", "d"): {"dhrnet": right, "ggcnn": wrong, "lenz": right},
        ("iw", "rgb"): {"dhrnet": wrong, "ggcnn": wrong, "lenz": wrong},
    }
    tests = splits.tests_of(cells)
    told = {(row["channels"], row["a"], row["b"]): (row["only_a"], row["only_b"], row["p"]) for row in tests}
    assert told == {
        ("d", "dhrnet", "ggcnn"): (8, 0, 2 / 2**8),
        ("d", "dhrnet", "lenz"): (0, 0, 1.0),
        ("rgb", "dhrnet", "ggcnn"): (0, 0, 1.0),
        ("rgb", "dhrnet", "lenz"): (0, 0, 1.0),
        ("all", "d", "rgb"): (8, 0, 2 / 2**8),
    }
    assert max(row["p_holm"] for row in tests if row["p"] < 0.01) == pytest.approx(5 * 2 / 2**8)


def test_a_study_trains_tests_publishes_and_goes_on_where_it_was(
    splits: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    data = write_shards(tmp_path / "data", shards=2, images=4, size=224)
    words = ["--data", str(data), "--work", str(tmp_path / "work"), "--out", str(tmp_path / "out")]
    words += ["--detector", "ggcnn2", "--channels", "d", "--limit", "8", "--epochs", "1", "--batch", "2"]
    assert splits.main(words) == 0
    assert "ggcnn2     d      iw" in capfd.readouterr().out
    with (tmp_path / "out" / "generated-splits.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["split"], row["best_n"]) for row in rows] == [("iw", "8"), ("ow", "8")]
    told = json.loads((tmp_path / "out" / "run.json").read_text())
    assert (told["limit"], told["epochs"], told["data"]) == (8, 1, "data")

    def never(_: object) -> int:
        raise AssertionError("trained anew")

    monkeypatch.setattr(splits, "evaluate", never)
    assert splits.main(words) == 0
    assert splits.main([*words, "--epochs", "2"]) == 2
    assert "a result of other settings is in the way" in capfd.readouterr().err
