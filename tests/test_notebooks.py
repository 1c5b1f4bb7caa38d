"""The notebooks run from top to bottom."""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import Any

import matplotlib
import pytest

NOTEBOOKS = sorted((Path(__file__).resolve().parents[1] / "docs" / "notebooks").glob("*.ipynb"))


def run(notebook: Path) -> tuple[dict[str, Any], list[Any]]:
    """Names that its code leaves, and the values of the last lines of its cells, as a kernel shows them."""
    names: dict[str, Any] = {}
    shown = []
    for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
        assert not cell.get("outputs"), "notebooks are kept without outputs"
        if cell["cell_type"] != "code":
            continue
        *lines, last = ast.parse("".join(cell["source"])).body
        exec(compile(ast.Module(lines, []), notebook.name, "exec"), names)
        if isinstance(last, ast.Expr):
            shown.append(eval(compile(ast.Expression(last.value), notebook.name, "eval"), names))
        else:
            exec(compile(ast.Module([last], []), notebook.name, "exec"), names)
    return names, shown


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_shows_what_it_says(
    notebook: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(matplotlib, "get_backend", lambda: "agg")
    matplotlib.use("Agg", force=True)
    names, shown = run(notebook)
    said = capsys.readouterr().out
    if notebook.stem == "first_episode":
        assert shown[0]._repr_png_().startswith(b"\x89PNG")
        assert "<img" in shown[1]._repr_html_()
        assert str(names["result"].outcome) == "success"
        assert "4 of 4" in said
    else:
        assert "peak: True" in said
        assert "and physics says: success" in said


def test_there_are_two() -> None:
    assert [path.stem for path in NOTEBOOKS] == ["first_episode", "what_the_controller_sees"]
