"""A report as blocks of text, tables and pictures, and the two forms it is written in: HTML and Markdown.

Both forms are made from the same blocks, so that they say the same. The HTML is one file that needs
nothing else: it forbids itself every network request by its content security policy.
"""

from __future__ import annotations

import html
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias


@dataclass(frozen=True, kw_only=True)
class Paragraph:
    """Text; what stands between single backticks is code."""

    text: str


@dataclass(frozen=True, kw_only=True)
class Listing:
    """Commands, one a line."""

    lines: Sequence[str]


@dataclass(frozen=True, kw_only=True)
class Table:
    """Cells are text as in `Paragraph`; all rows are as long as the headings."""

    caption: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    """What the marks in it mean."""

    def __post_init__(self) -> None:
        assert all(len(row) == len(self.headings) for row in self.rows), self.caption


@dataclass(frozen=True, kw_only=True)
class Picture:
    """A drawing; Markdown has its caption and its description only."""

    caption: str
    alt: str
    """What there is to see, for those who cannot."""
    markup: str
    """Inline SVG, or `<img>` elements with data URIs."""
    wide: bool = False
    """Whether it takes the whole width."""


@dataclass(frozen=True, kw_only=True)
class Folded:
    """Blocks that are shown on demand."""

    summary: str
    blocks: Sequence[Block]


@dataclass(frozen=True, kw_only=True)
class Section:
    """Blocks under a heading."""

    title: str
    blocks: Sequence[Block] = field(default_factory=tuple)


Block: TypeAlias = "Paragraph | Listing | Table | Picture | Folded"

_STYLE = """
:root{color-scheme:light dark;--ink:#1b1f24;--paper:#fff;--soft:#59636e;--line:#d1d9e0;
--shade:#f3f5f7;--link:#0a58ca}
@media(prefers-color-scheme:dark){:root{--ink:#e3e7eb;--paper:#14171b;--soft:#9aa4ae;--line:#3a424b;
--shade:#1f242a;--link:#7db4ff}}
*{box-sizing:border-box}
body{margin:0 auto;max-width:76rem;padding:1rem;background:var(--paper);color:var(--ink);
font:16px/1.5 system-ui,sans-serif;overflow-wrap:break-word}
h1{font-size:1.6rem;line-height:1.25}
h2{font-size:1.25rem;margin-top:2.2rem;border-bottom:1px solid var(--line)}
a{color:var(--link)}
nav ul{padding:0;list-style:none;display:flex;flex-wrap:wrap;gap:.2rem 1rem}
.box{overflow-x:auto;margin:.8rem 0;max-width:100%}
.box:focus-visible,summary:focus-visible{outline:2px solid var(--link)}
table{border-collapse:collapse;font-size:.875rem;font-variant-numeric:tabular-nums}
caption{text-align:left;font-weight:600;padding:.3rem 0}
th,td{border:1px solid var(--line);padding:.25rem .55rem;text-align:left;vertical-align:top}
th{background:var(--shade)}
th,td{white-space:nowrap}
th.long,td.long{white-space:normal;min-width:16rem}
th.long{min-width:5.5rem}
code,pre{font:.85em ui-monospace,monospace}
pre{background:var(--shade);padding:.6rem;white-space:pre-wrap;overflow-wrap:anywhere}
.note,figcaption{color:var(--soft);font-size:.875rem}
.note{margin-top:-.5rem}
.pictures{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,24rem),1fr));gap:1rem;
align-items:start}
figure{margin:0;min-width:0}
figure.wide{grid-column:1/-1}
figure svg{width:100%;height:auto;max-width:32rem;display:block;color:var(--ink)}
.strip{display:flex;flex-wrap:wrap;gap:4px}
.strip img{flex:1 1 10rem;min-width:0;max-width:22rem;height:auto;display:block}
details{margin:.6rem 0}
summary{cursor:pointer}
""".strip()
_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
_LONG = 48
"""Characters from which on a cell of a table may be folded."""
_LONG_HEADING = 14
"""The same of a heading, which is folded into lines of about as many."""


def to_html(title: str, sections: Sequence[Section]) -> str:
    """The whole page: inline style and pictures, no scripts, nothing to load."""
    links = "".join(f'<li><a href="#{_anchor(s.title)}">{_text(s.title)}</a></li>' for s in sections)
    body = "\n".join(
        f'<section id="{_anchor(s.title)}"><h2>{_text(s.title)}</h2>\n{_html_blocks(s.blocks)}\n</section>'
        for s in sections
    )
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{_POLICY}">
<link rel="icon" href="data:,">
<title>{html.escape(title)}</title>
<style>
{_STYLE}
</style>
</head>
<body>
<main>
<h1>{_text(title)}</h1>
<nav aria-label="Sections"><ul>{links}</ul></nav>
{body}
</main>
</body>
</html>
"""


def to_markdown(title: str, sections: Sequence[Section]) -> str:
    """The same without the pictures, of which it gives captions and descriptions."""
    parts = [f"# {_markdown(title)}"]
    for section in sections:
        parts += [f"## {_markdown(section.title)}", *_markdown_blocks(section.blocks)]
    return "\n\n".join(parts) + "\n"


def _anchor(title: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")


def _pieces(text: str) -> list[str]:
    """Text and code in turn; all is text where the backticks are not in pairs, or stand side by side."""
    pieces = text.split("`")
    return [text] if len(pieces) % 2 == 0 or "``" in text else pieces


def _text(text: str) -> str:
    """Escaped text with its code marked up."""
    pieces = [html.escape(piece, quote=True) for piece in _pieces(text)]
    return "".join(f"<code>{piece}</code>" if k % 2 else piece for k, piece in enumerate(pieces))


def _markdown(text: str) -> str:
    """The same in one line of Markdown, in which there is no HTML."""
    pieces = _pieces(" ".join(text.splitlines()))
    return "`".join(piece if k % 2 else piece.replace("<", "&lt;") for k, piece in enumerate(pieces))


def _html_blocks(blocks: Iterable[Block]) -> str:
    parts: list[str] = []
    row: list[str] = []

    def end_row() -> None:
        if row:
            parts.append(f'<div class="pictures">\n{"".join(row)}</div>')
            row.clear()

    for block in blocks:
        if isinstance(block, Picture):
            row.append(_html_picture(block))  # pictures in sequence stand beside each other
            continue
        end_row()
        parts.append(_html_block(block))
    end_row()
    return "\n".join(parts)


def _html_block(block: Paragraph | Listing | Table | Folded) -> str:
    match block:
        case Paragraph():
            return f"<p>{_text(block.text)}</p>"
        case Listing():
            return f"<pre>{html.escape(chr(10).join(block.lines))}</pre>"
        case Table():
            return _html_table(block)
        case Folded():
            inner = _html_blocks(block.blocks)
            return f"<details><summary>{_text(block.summary)}</summary>\n{inner}\n</details>"


def _html_picture(picture: Picture) -> str:
    wide = ' class="wide"' if picture.wide else ""
    return f"<figure{wide}>{picture.markup}<figcaption>{_text(picture.caption)}</figcaption></figure>\n"


def _html_table(table: Table) -> str:
    head = "".join(
        f'<th scope="col"{" class=long" if len(heading) > _LONG_HEADING else ""}>{_text(heading)}</th>'
        for heading in table.headings
    )
    rows = "\n".join(
        "<tr>"
        + "".join(f"<td{' class=long' if len(cell) > _LONG else ''}>{_text(cell)}</td>" for cell in row)
        + "</tr>"
        for row in table.rows
    )
    name = html.escape(table.caption, quote=True)
    note = f'\n<p class="note">{_text(table.note)}</p>' if table.note else ""
    return (
        f'<div class="box" role="region" tabindex="0" aria-label="{name}"><table>'
        f"<caption>{_text(table.caption)}</caption>\n<thead><tr>{head}</tr></thead>\n"
        f"<tbody>\n{rows}\n</tbody></table></div>{note}"
    )


def _markdown_blocks(blocks: Iterable[Block]) -> list[str]:
    parts: list[str] = []
    for block in blocks:
        match block:
            case Paragraph():
                parts.append(_markdown(block.text))
            case Listing():
                parts.append("\n".join(["```sh", *block.lines, "```"]))
            case Table():
                parts += [f"**{_markdown(block.caption)}**", _markdown_table(block)]
                if block.note:
                    parts.append(_markdown(block.note))
            case Picture():
                said = f"*Picture in report.html: {_markdown(block.caption)}* {_markdown(block.alt)}"
                parts.append(said)
            case Folded():
                inner = _markdown_blocks(block.blocks)
                parts += [f"<details><summary>{_text(block.summary)}</summary>", *inner, "</details>"]
    return parts


def _markdown_table(table: Table) -> str:
    rows = [list(table.headings), ["---"] * len(table.headings), *table.rows]
    return "\n".join("| " + " | ".join(map(_markdown_cell, row)) + " |" for row in rows)


def _markdown_cell(cell: str) -> str:
    # backslashes before a bar would take its own one away
    return re.sub(r"(\\*)\|", r"\1\1\\|", _markdown(cell))
