"""The verdict on a plug-in: a table for people, or JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass

from rich.console import Console
from rich.table import Table
from rich.text import Text

from mpgrasp.check.laws import Finding, State

_WIDTH = 110
"""Columns of a table that is not read on a terminal."""
_SIGNS = {State.PASSED: ("ok", "green"), State.SKIPPED: ("skipped", "yellow")}


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """All findings about one plug-in."""

    kind: str
    """detector or controller."""
    name: str
    findings: Sequence[Finding]

    @property
    def fit(self) -> bool:
        """True if no law is broken."""
        return not any(finding.broken for finding in self.findings)

    def words(self) -> str:
        """Return the verdict in a sentence or two."""
        laws = [finding for finding in self.findings if finding.must]
        held = sum(finding.state is State.PASSED for finding in laws)
        skipped = sum(finding.state is State.SKIPPED for finding in laws)
        broken = [finding.name for finding in laws if finding.broken]
        advice = [f.name for f in self.findings if not f.must and f.state is State.FAILED]
        left = f", {skipped} could not be tried" if skipped else ""
        if broken:
            start = (
                f"NOT FIT: {self.name} breaks {len(broken)} of {len(laws)} laws ({', '.join(broken)}){left}."
            )
            return f"{start} What is to be done stands in the table; results of a run would mean nothing."
        start = f"FIT: {self.name} keeps {held} of {len(laws)} laws{left}."
        return f"{start} Worth a look: {', '.join(advice)}." if advice else start

    def as_json(self) -> str:
        """Return it as JSON: kind, name, fit, verdict, and findings with check, must, state and reason."""
        rows = [
            {"check": f.name, "must": f.must, "state": f.state.value, "reason": f.reason}
            for f in self.findings
        ]
        about = {"kind": self.kind, "name": self.name, "fit": self.fit, "verdict": self.words()}
        return json.dumps({**about, "findings": rows}, indent=2)

    def print(self, console: Console | None = None) -> None:
        """Print a table of the findings and the verdict."""
        console = console or Console()
        if not console.is_terminal:
            console.width = _WIDTH
        table = Table(title=Text(f"{self.kind} {self.name}"), title_justify="left", show_lines=False)
        table.add_column("check", no_wrap=True)
        table.add_column("", no_wrap=True)
        table.add_column("what was found")
        for finding in self.findings:
            sign, style = _SIGNS.get(
                finding.state, ("BROKEN", "bold red") if finding.must else ("advice", "yellow")
            )
            table.add_row(Text(finding.name), Text(sign, style=style), Text(finding.reason))
        console.print(table)
        console.print(Text(self.words(), style="green" if self.fit else "bold red"))
