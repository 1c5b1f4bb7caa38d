from __future__ import annotations

import html
import json
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from toy_runs import CARD, EPISODES, lines, make_run, trace

from mpgrasp.bench.report.build import write_report

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
CHROMIUM = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)

pytestmark = pytest.mark.skipif(
    CHROMIUM is None, reason=f"no browser: none of {', '.join(NAMES)} on the PATH, and no $CHROMIUM"
)

FRAME = """<!DOCTYPE html>
<title>not measured</title>
<body style="margin:0">
<script>
function measure(frame) {
  const page = frame.contentDocument, width = frame.contentWindow.innerWidth;
  page.querySelectorAll("details").forEach(folded => { folded.open = true; });
  const inside = [...page.querySelectorAll("p, h1, h2, summary, figure, .box, pre, nav")];
  document.title = JSON.stringify({
    inner: width,
    scroll: page.documentElement.scrollWidth,
    beyond: inside.filter(e => e.getBoundingClientRect().right > width + 1).map(e => e.textContent),
  });
}
</script>
<iframe onload="measure(this)" style="border:0;height:2000px;width:%(width)dpx" srcdoc="%(page)s"></iframe>
</body>
"""
"""Shows a page in a frame, since windows have a least width; unfolds everything and measures it."""


class Seen(NamedTuple):
    """A page as a browser saw it."""

    measured: dict[str, Any]
    console: list[str]
    """Complaints of the browser."""
    requests: list[str]
    """Addresses that the page asked the network for."""


def look(page: str, folder: Path, width: int) -> Seen:
    """Open a page in a frame of that width [px]; no name is resolved."""
    folder.mkdir()
    file, log = folder / "frame.html", folder / "net.json"
    file.write_text(FRAME % {"width": width, "page": html.escape(page)})
    command = [
        str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
        "--hide-scrollbars", "--no-first-run", "--disable-background-networking", "--dump-dom",
        "--host-resolver-rules=MAP * ~NOTFOUND", f"--user-data-dir={folder / 'profile'}",
        f"--log-net-log={log}", "--enable-logging=stderr", "--window-size=1400,2000", file.as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)
    found = re.search(r"<title>(.*?)</title>", done.stdout, re.DOTALL)
    assert found, done.stderr
    asked = [event.get("params", {}) for event in json.loads(log.read_text())["events"]]
    return Seen(
        measured=json.loads(html.unescape(found[1])),
        console=[line for line in done.stderr.splitlines() if "CONSOLE" in line],
        requests=[
            what["url"]
            for what in asked
            # what the browser asks for on its own account has no origin
            if re.match("(http|ws|ftp)s?:", what.get("url", ""))
            and what.get("initiator", "not an origin") != "not an origin"
        ],
    )


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A report with long names, folded tables, figures and filmstrips."""
    long = lines("10" * 20, detector="a_package.with_a_module:AndARatherLongNameOfItsClass", controller="mvp")
    folder = make_run(tmp_path_factory.mktemp("browser") / ("a-long-name-" * 8), [*EPISODES, *long], **CARD)
    for line in (EPISODES[0], EPISODES[2], long[0]):
        trace(folder / "traces", line)
    return write_report([folder], folder).read_text()


@pytest.mark.parametrize("width", [1280, 400])
def test_a_report_fits_its_window_and_asks_for_nothing(report: str, tmp_path: Path, width: int) -> None:
    seen = look(report, tmp_path / "seen", width)
    assert seen.measured["inner"] == width
    assert seen.measured["scroll"] <= width
    assert seen.measured["beyond"] == []
    assert seen.console == []
    assert seen.requests == []


def test_the_browser_tells_of_width_console_and_requests(tmp_path: Path) -> None:
    page = (
        "<!DOCTYPE html><title>-</title><body><script>console.error('broken')</script>"
        "<p style='width:3000px'>wide</p><img src='http://picture.invalid/a.png'></body>"
    )
    seen = look(page, tmp_path / "seen", 400)
    assert seen.measured["scroll"] >= 3000
    assert seen.measured["beyond"] == ["wide"]
    assert any("broken" in line for line in seen.console)
    assert "http://picture.invalid/a.png" in seen.requests
