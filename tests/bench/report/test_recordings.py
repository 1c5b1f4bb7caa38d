"""Laws of the links to recordings: they lead from the report to files that are there."""

from __future__ import annotations

import re
from pathlib import Path
from urllib.parse import unquote

from toy_runs import EPISODES, make_run

from mpgrasp.bench.report.build import write_report


def linked(page: Path) -> list[Path]:
    addresses = re.findall(r'<a href="([^"#][^"]*)">', page.read_text())
    return [page.parent / unquote(address) for address in addresses]


def test_recordings_are_linked_from_wherever_the_report_is(tmp_path: Path) -> None:
    run = make_run(tmp_path / "a run", EPISODES)
    (run / "recordings").mkdir()
    made = [
        run / "recordings" / f"{line.task.stem}{ending}"
        for line, endings in ((EPISODES[0], (".rrd", ".gif", ".mp4")), (EPISODES[5], (".gif",)))
        for ending in endings
    ]
    for path in made:
        path.write_bytes(b"x")
    (run / "recordings" / "notes.txt").write_text("not a recording")
    for out in (run, tmp_path / "else where"):
        page = write_report([run], out)
        found = linked(page)
        assert {path.resolve() for path in found} == {path.resolve() for path in made}
        assert "Recordings" in page.read_text()
        assert (out / "report.md").read_text().count("](") == len(made)


def test_without_recordings_nothing_is_said_of_them(tmp_path: Path) -> None:
    page = write_report([make_run(tmp_path / "run", EPISODES)], tmp_path / "run")
    assert "Recordings" not in page.read_text()
    assert linked(page) == []
