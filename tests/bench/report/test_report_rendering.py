from __future__ import annotations

import re
from importlib.resources import files

import pytest

from mpgrasp.bench.report.document import Figure, Filmstrip, Still, Table
from mpgrasp.bench.report.rendering import environment

NASTY = "a <b> & | `c<d>`"


def rendered(form: str, body: str, **context: object) -> str:
    """A few elements in one of the forms of a report: "html" or "md"."""
    source = f'{{% import "elements.{form}.j2" as e %}}{body}'
    return environment().from_string(source).render(context)


def test_text_is_escaped_and_code_is_marked() -> None:
    body = "{% call e.text() %}{{ said }}{% endcall %}"
    assert "<p>a &lt;b&gt; &amp; | <code>c&lt;d&gt;</code></p>" in rendered("html", body, said=NASTY)
    assert rendered("md", body, said=NASTY).strip() == "a &lt;b> & | `c<d>`"


def test_commands_are_given_as_they_are() -> None:
    assert "<pre>x &gt; y\nz</pre>" in rendered("html", "{{ e.commands(lines) }}", lines=["x > y", "z"])
    assert "```sh\nx > y\nz\n```" in rendered("md", "{{ e.commands(lines) }}", lines=["x > y", "z"])


def test_every_part_of_a_table_is_escaped() -> None:
    table = Table(caption=NASTY, headings=(NASTY,), rows=[(NASTY,), ("p|q `r",)], note=NASTY)
    body = "{% call e.folded(table.caption) %}{{ e.table(table) }}{% endcall %}"
    page = rendered("html", body, table=table)
    assert "<b>" not in page
    assert page.count("a &lt;b&gt; &amp; | <code>c&lt;d&gt;</code>") == 5
    assert "p|q `r</td>" in page
    assert page.count('<td data-label="a &lt;b&gt; &amp; | c&lt;d&gt;"') == 2, (
        "a narrow page needs the heading"
    )
    assert "| p\\|q `r |" in rendered("md", body, table=table)


def test_figures_and_stills_have_their_descriptions() -> None:
    figure = Figure(caption=NASTY, alt=NASTY, svg="<svg></svg>")
    strip = Filmstrip(caption="six", alt="a strip", stills=[Still(source="data:,", alt='a "b"')])
    body = "{{ e.figures([figure]) }}{{ e.filmstrip(strip) }}"
    page = rendered("html", body, figure=figure, strip=strip)
    assert "<svg></svg>" in page
    assert '<img src="data:,"' in page
    assert "a &#34;b&#34;" in page
    assert "<b>" not in page
    markdown = rendered("md", body, figure=figure, strip=strip)
    assert "*Figure in report.html: a &lt;b> & | `c<d>`* a &lt;b> & | `c<d>`" in markdown
    assert "*Figure in report.html: six* a strip" in markdown


@pytest.mark.parametrize(
    "cell",
    [
        "two\nlines",
        "two\r\nlines",
        "<script>alert(1)</script>",
        "a | b",
        "a \\| b",
        "``` <script> `",
        "` <b>",
    ],
)
def test_no_cell_of_markdown_tears_its_table_or_brings_html(cell: str) -> None:
    table = Table(caption=cell, headings=("a", cell), rows=[(cell, "last")], note=cell)
    markdown = rendered(
        "md", "{{ e.table(table) }}{% call e.text() %}{{ cell }}{% endcall %}", table=table, cell=cell
    )
    assert "<" not in markdown
    rows = [line for line in markdown.split("\n") if line.startswith("| ")]
    assert len(rows) == 3
    for row in rows:
        # a bar is the table's unless it is behind a backslash that is not itself behind one
        assert len(re.findall(r"(?<!\\)(?:\\\\)*\|", row)) == 3
    assert rows[2].endswith(" | last |")


def test_markdown_tables_are_not_torn_by_empty_lines() -> None:
    table = Table(caption="t", headings=("a", "b"), rows=[("1", "2"), ("3", "4")])
    assert "| a | b |\n| --- | --- |\n| 1 | 2 |\n| 3 | 4 |\n" in rendered(
        "md", "{{ e.table(table) }}", table=table
    )


def test_templates_and_style_are_files_of_the_package() -> None:
    shipped = {file.name for file in (files("mpgrasp.bench.report") / "templates").iterdir()}
    assert shipped == {*environment().list_templates()}
    assert {"report.html.j2", "report.md.j2", "style.css"} <= shipped
