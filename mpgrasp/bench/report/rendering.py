"""Rendering of a report by the templates beside this module: one HTML page, and the same in Markdown.

`report.html.j2` and `report.md.j2` share `sections.j2`, which lays the sections out once, so that both say
the same. The page is one file that needs nothing else: it forbids itself every network request by its
content security policy.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from mpgrasp.names import printable

if TYPE_CHECKING:
    from mpgrasp.bench.report.build import Report


def to_html(report: Report) -> str:
    """The whole page: inline style and figures, no scripts, nothing to load."""
    return environment().get_template("report.html.j2").render(report=report)


def to_markdown(report: Report) -> str:
    """The same without the figures, of which it gives captions and descriptions."""
    text = environment().get_template("report.md.j2").render(report=report)
    return re.sub(r"\n{3,}", "\n\n", text).strip("\n") + "\n"


def environment() -> Environment:
    """Templates and filters of a report; whatever a template prints is escaped unless a filter did so."""
    made = Environment(
        loader=PackageLoader("mpgrasp.bench.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters |= {"anchor": anchor, "html": html, "markdown": markdown, "markdown_cell": markdown_cell}
    return made


def anchor(title: str) -> str:
    """A title as the name of a place in the page."""
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")


def html(text: str) -> Markup:
    """Escaped text with its code marked up."""
    pieces = _pieces(escape(_visible(text)))
    return Markup("").join(
        Markup(f"<code>{piece}</code>" if k % 2 else piece) for k, piece in enumerate(pieces)
    )


def markdown(text: str) -> Markup:
    """Text in one line of Markdown, in which there is no HTML but in code."""
    said = _visible(text.unescape() if isinstance(text, Markup) else text)
    pieces = _pieces(" ".join(line for row in said.splitlines() if (line := row.strip())))
    return Markup("`".join(piece if k % 2 else piece.replace("<", "&lt;") for k, piece in enumerate(pieces)))


def markdown_cell(text: str) -> Markup:
    """The same in a table, whose bars it must not add to."""
    # backslashes before a bar would take its own one away
    return Markup(re.sub(r"(\\*)\|", r"\1\1\\|", markdown(text)))


def _visible(text: str) -> str:
    """Text in which control characters of names are escaped, but for line ends."""
    return text if isinstance(text, Markup) else "\n".join(map(printable, text.splitlines()))


def _pieces(text: str) -> list[str]:
    """Text and code in turn; all is text where the backticks are not in pairs, or stand side by side."""
    pieces = text.split("`")
    return [text] if len(pieces) % 2 == 0 or "``" in text else pieces
