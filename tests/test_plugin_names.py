"""Laws of the names of plug-ins: files, entry points and weights lead to who plays, or to one clear error."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from mpgrasp import plugin_names
from mpgrasp.bench.__main__ import main
from mpgrasp.detectors.network_detector import NetworkDetector
from mpgrasp.exceptions import ConfigError
from mpgrasp.paths import WEIGHTS
from mpgrasp.plugin_names import base_name, canonical, detectors_of, method_of, names_of
from mpgrasp.plugins import load_controller, load_detector

SOURCE = """
from mpgrasp.detectors.heuristic import HeuristicDetector
from mpgrasp.controllers.straight_down import StraightDown

from beside_it import FACTOR

def heuristic(min_area=30):
    from mpgrasp.detectors.config import HeuristicConfig
    made = HeuristicDetector(HeuristicConfig(min_area=int(min_area * FACTOR)))
    return made

class Down(StraightDown):
    pass
"""


@pytest.fixture(autouse=True)
def _imports_as_before() -> Iterator[None]:
    path, modules = list(sys.path), set(sys.modules)
    yield
    sys.path[:] = path
    for name in set(sys.modules) - modules:
        if name in ("my_plug_in", "beside_it"):
            del sys.modules[name]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    folder = tmp_path / "my plug-ins"
    folder.mkdir()
    (folder / "my_plug_in.py").write_text(SOURCE)
    (folder / "beside_it.py").write_text("FACTOR = 2")
    return folder / "my_plug_in.py"


def test_a_file_is_a_module_from_then_on_and_finds_what_lies_beside_it(file: Path) -> None:
    assert canonical("detector", f"{file}:heuristic") == "my_plug_in:heuristic"
    assert load_detector(f"{file}:heuristic", settings={"min_area": 20}).config.min_area == 40  # type: ignore[attr-defined]
    assert type(load_controller(f"{file}:Down")).__name__ == "Down"


def test_a_run_with_a_file_says_the_module_and_plays_it_in_workers(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(file.parent)
    words = ["thin", "--detector", "./my_plug_in.py:heuristic", "--controller", "./my_plug_in.py:Down"]
    words += ["--episodes", "1", "--camera", "ray", "--quiet", "--out", str(tmp_path / "out")]
    assert main([*words, "--workers", "1"]) == 0
    (line,) = (tmp_path / "out" / "episodes.jsonl").read_text().splitlines()
    told = json.loads(line)
    assert (told["detector"], told["controller"]) == ("my_plug_in:heuristic", "my_plug_in:Down")
    card = json.loads((tmp_path / "out" / "run.json").read_text())["configuration"]["detectors"][0]
    assert card["source"], "a run is not finished with a plug-in that has changed"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("{file}", "names no class"),
        ("{file}:", "names no class"),
        ("{file}:a.b", "names no class"),
        ("{folder}/absent.py:X", "no such file"),
        ("{folder}/json.py:X", "name of another module"),
        ("{folder}/my-net.py:X", "in a file that is no module"),
    ],
)
def test_a_file_that_is_no_plug_in_is_refused(name: str, said: str, file: Path) -> None:
    for other in ("json.py", "my-net.py"):
        (file.parent / other).write_text("X = 1")
    with pytest.raises(ConfigError, match=said):
        canonical("detector", name.format(file=file, folder=file.parent))


def test_an_installed_package_is_known_by_the_name_that_it_gives_itself(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(file.parent))
    made = {
        "mpgrasp.detectors": [
            EntryPoint("theirs", "my_plug_in:heuristic", "mpgrasp.detectors"),
            EntryPoint("oracle", "my_plug_in:heuristic", "mpgrasp.detectors"),
        ],
        "mpgrasp.controllers": [EntryPoint("theirs", "my_plug_in:Down", "mpgrasp.controllers")],
    }
    monkeypatch.setattr(plugin_names, "entry_points", lambda group: made[group])
    assert names_of("detector", "theirs,dhrnet,oracle") == ["my_plug_in:heuristic", "dhrnet", "oracle"]
    assert canonical("controller", "theirs") == "my_plug_in:Down"
    assert type(load_controller("theirs")).__name__ == "Down"
    with pytest.raises(ConfigError, match="unknown detector; got 'others'"):
        load_detector("others")


def test_several_weights_of_one_network_are_several_detectors(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / f"{name}.safetensors").write_bytes((WEIGHTS / "ggcnn.safetensors").read_bytes())
    typed = ",".join(f"ggcnn@{tmp_path}/{name}.safetensors" for name in ("a", "b"))
    names, weights = detectors_of(f"{typed},oracle")
    assert names == ["ggcnn@a", "ggcnn@b", "oracle"]
    assert weights == {f"ggcnn@{name}": tmp_path / f"{name}.safetensors" for name in ("a", "b")}
    assert [base_name(name) for name in names] == ["ggcnn", "ggcnn", "oracle"]
    made = load_detector(typed.split(",")[0])
    assert isinstance(made, NetworkDetector)
    words = ["thin", "--detector", typed, "--controller", "straight_down", "--episodes", "1"]
    words += ["--camera", "ray", "--quiet", "--workers", "0", "--out", str(tmp_path / "out")]
    assert main(words) == 0
    lines = [json.loads(line) for line in (tmp_path / "out" / "episodes.jsonl").read_text().splitlines()]
    assert [line["detector"] for line in lines] == ["ggcnn@a", "ggcnn@b"]
    assert lines[0]["state_hash"] == lines[1]["state_hash"], "they are the same weights"


@pytest.mark.parametrize("typed", ["ggcnn@", "@x.pt", "ggcnn@a/w.pt,ggcnn@b/w.pt"])
def test_weights_that_cannot_be_told_apart_or_are_none_are_refused(typed: str) -> None:
    with pytest.raises(ConfigError):
        detectors_of(typed)


@pytest.mark.parametrize(
    ("text", "method"),
    [
        ("dhrnet/mppc", ("dhrnet", "mppc")),
        ("./a/d.py:D/mppc", ("./a/d.py:D", "mppc")),
        ("./d.py:D/./c.py:C", ("./d.py:D", "./c.py:C")),
        ("dhrnet@w/x.safetensors/mppc", ("dhrnet@w/x.safetensors", "mppc")),
        ("net:N/m.c:C", ("net:N", "m.c:C")),
    ],
)
def test_a_method_is_a_detector_and_a_controller_however_they_are_named(
    text: str, method: tuple[str, str]
) -> None:
    assert method_of(text) == method


@pytest.mark.parametrize("text", ["dhrnet", "dhrnet/", "/mppc", "a/b/c", ""])
def test_what_is_no_method_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="unusable method"):
        method_of(text)
