"""Laws of the Python calls: they play what the command line plays, with names or with objects."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from fakes import FakeController, FakeDetector

import mpgrasp
from mpgrasp.api.players import Players
from mpgrasp.api.results import COLUMNS, Results
from mpgrasp.api.views import EpisodeView
from mpgrasp.bench.__main__ import main
from mpgrasp.brought import brought_names
from mpgrasp.exceptions import ConfigError, OutputError
from mpgrasp.plugins import detector_names

SETTINGS = {"scene.cloth_unevenness": 0.001, "controller.v_z": 0.04}
WAY: dict[str, Any] = {"camera": "ray", "progress": False, "workers": 0}


def hashes(folder: Path) -> list[str]:
    return [json.loads(line)["state_hash"] for line in (folder / "episodes.jsonl").read_text().splitlines()]


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Results:
    out = tmp_path_factory.mktemp("api") / "run"
    return mpgrasp.evaluate(
        "heuristic", ["straight_down", "open_loop"], episodes=1, seed=4, out=out,
        settings=SETTINGS, **WAY,
    )  # fmt: skip


def test_a_call_plays_the_episodes_of_the_command_line_bit_for_bit(played: Results, tmp_path: Path) -> None:
    words = ["thin", "--detector", "heuristic", "--controller", "straight_down,open_loop", "--episodes", "1"]
    words += ["--seed", "4", "--camera", "ray", "--workers", "0", "--quiet", "--out", str(tmp_path / "run")]
    words += ["--set", "scene.cloth_unevenness=0.001", "--set", "controller.v_z=0.04"]
    assert main(words) == 0
    assert hashes(tmp_path / "run") == hashes(played.folder)
    assert len(played) == 2


def test_results_are_those_of_the_summary(played: Results) -> None:
    summary = json.loads((played.folder / "summary.json").read_text())
    assert [cell.successes for cell in played.cells] == [cell["successes"] for cell in summary["cells"]]
    assert [line.outcome for line in played] == [line.outcome for line in played.episodes]
    assert played.complete
    assert played.cell("heuristic", "open_loop").controller == "open_loop"
    for names in (("heuristic",), ("dhrnet",)):
        with pytest.raises(ConfigError, match="cells of that name"):
            played.cell(*names)
    (test,) = played.paired_tests
    assert {test.a.controller, test.b.controller} == {"straight_down", "open_loop"}


def test_the_table_fits_eighty_columns_and_the_plot_has_every_cell(played: Results) -> None:
    table = played.table()
    assert max(map(len, table.splitlines())) <= COLUMNS
    assert "straight_down" in table
    assert repr(played) == table
    assert played._repr_html_().count("<tr>") == 3
    axes = played.plot()
    assert [label.get_text() for label in axes.get_yticklabels()].count("heuristic/open_loop") == 1


def test_results_are_saved_once_and_read_again(played: Results, tmp_path: Path) -> None:
    folder = played.save(tmp_path / "kept")
    assert (folder / "report.html").is_file()
    assert [line.as_row() for line in Results(folder)] == [line.as_row() for line in played]
    with pytest.raises(OutputError, match="not empty"):
        played.save(folder)
    with pytest.raises(OutputError, match="no finished run"):
        Results(tmp_path / "nowhere")


def test_without_pandas_it_is_said_what_to_do(played: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ConfigError, match="pip install pandas"):
        played.to_dataframe()


def test_a_data_frame_has_a_row_per_episode(played: Results) -> None:
    pandas = pytest.importorskip("pandas")
    frame = played.to_dataframe()
    assert isinstance(frame, pandas.DataFrame)
    assert list(frame["state_hash"]) == hashes(played.folder)


def test_objects_play_and_are_forgotten_afterwards(
    fake_world: object, capsys: pytest.CaptureFixture[str]
) -> None:
    detectors = {"one": FakeDetector(), "two": FakeDetector()}
    results = mpgrasp.evaluate(detectors, FakeController(), episodes=3, progress=False)
    assert [cell.detector for cell in results.cells] == ["one", "two"]
    assert {cell.n for cell in results.cells} == {3}
    assert brought_names("detector") == brought_names("controller") == ()
    assert capsys.readouterr().out == ""
    folder = results.folder
    assert folder.is_dir()
    del results
    assert not folder.exists(), "what nobody saved goes with the results"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"detector": FakeDetector}, "is a class"),
        ({"detector": []}, "no detector"),
        ({"detector": {"dhrnet": FakeDetector()}}, "unusable name of a detector; got 'dhrnet'"),
        ({"detector": object()}, "lacks reset, predict"),
        ({"detector": "resnet"}, "unknown detector; got 'resnet'"),
        ({"suite": "thick"}, "unknown suite"),
        ({"episodes": 0}, "unusable number"),
        ({"detector": FakeDetector(), "workers": 2}, "objects play in this process alone; got .workers=2"),
        ({"detector": {"one": FakeDetector()}, "weights": {"one": "absent.pt"}}, "absent.pt"),
        ({"detector": FakeDetector(), "settings": {"detector.size": 3}}, "no setting of"),
    ],
)
def test_what_cannot_be_played_is_said_by_one_error(arguments: dict[str, Any], said: str) -> None:
    with pytest.raises(mpgrasp.MpgraspError, match=said):
        mpgrasp.evaluate(**{"controller": "straight_down", "progress": False, "workers": 0, **arguments})


def test_objects_without_a_name_have_one_of_their_own() -> None:
    class Net:
        pass

    named = Net()
    named.name = "dhrnet"  # type: ignore[attr-defined]
    players = Players.of("detector", [Net(), Net(), named, "ggcnn"], detector_names())
    assert players.names == ["Net", "Net-2", "dhrnet-2", "ggcnn"]
    assert list(players.objects) == ["Net", "Net-2", "dhrnet-2"]


def test_an_episode_is_that_of_a_run_and_has_a_film(played: Results) -> None:
    seen = mpgrasp.episode("heuristic", "straight_down", seed=4, camera="ray", settings=SETTINGS)
    assert seen.result.as_record()["state_hash"] == played[0].state_hash
    assert seen.outcome == played[0].outcome
    height, width, channels = seen.last_frame().shape
    assert channels == 3
    assert min(height, width) > 200
    assert "data:image/gif;base64," in seen._repr_html_()
    bare = EpisodeView(result=seen.result, film=None)
    assert bare._repr_html_().startswith("<pre>")
    with pytest.raises(ConfigError, match="without a film"):
        bare.last_frame()


def test_a_scene_is_that_of_the_episode() -> None:
    view = mpgrasp.scene("thin", seed=3, episode=1)
    assert view.scene.seed == view.seed
    assert view._repr_png_().startswith(b"\x89PNG")
    assert "usb_stick" in repr(view)
    for bad in ({"seed": -1}, {"episode": True}, {"suite": "nowhere"}):
        with pytest.raises(ConfigError):
            mpgrasp.scene(**bad)


def test_packages_that_are_verbs_are_packages_still() -> None:
    code = (
        "import mpgrasp, mpgrasp.scene.config as c; from mpgrasp.episode.config import EpisodeConfig;"
        "print(callable(mpgrasp.scene), callable(mpgrasp.episode), callable(mpgrasp.evaluate), c.SceneConfig)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.startswith("True True True <class"), done.stderr
