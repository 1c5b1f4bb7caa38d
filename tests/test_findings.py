"""Numbers of README.md and docs/results.md are those of the result files that they name.

A table is bound by a comment before it, `cells by HEADING, ... := expression of HEADING, ..., column`. Other
numbers are bound by a comment in their section, `held`, with a line `words := expression` each. The words
stand in the section; their numbers, in order, are what the expression gives, rounded to the digits shown.
After "<" they are above it. Expressions call tests/published_runs.py and tests/published_studies.py.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import published_runs
import published_studies
import pytest
import table
from bench_runs import grasp_row

from mpgrasp.bench.analysis.hypotheses import count_verdicts, evaluate
from mpgrasp.bench.analysis.paper import Baseline
from mpgrasp.bench.analysis.summary import RunSummary, summarise
from mpgrasp.bench.record import line_of
from mpgrasp.bench.results.reader import read_lines
from mpgrasp.bench.stored_lines import by_cell
from mpgrasp.exceptions import ConfigError

pytestmark = pytest.mark.xdist_group("findings")  # one process reads the published runs, once

ROOT = Path(__file__).resolve().parent.parent
DOCUMENTS = ("README.md", "docs/results.md")
TEXTS = {name: (ROOT / name).read_text(encoding="utf-8") for name in DOCUMENTS}
MODIFIED = {
    path.parent.relative_to(table.RESULTS).as_posix()
    for path in table.RESULTS.rglob("run.json")
    if json.loads(path.read_text(encoding="utf-8"))["made_with"]["git"]["modified"]
}
"""Runs that were played from a modified checkout."""
FIGURES = {**vars(published_runs), **vars(published_studies)}
NUMBER = re.compile(r"(?<![\w.])(<\s*)?(-?\d[\d,]*(?:\.\d+)?)")
COMMENT = re.compile(r"<!--(.*?)-->", re.DOTALL)
TABLE = re.compile(
    r"(?:<!-- cells by ([^:]+?) := (.+?) -->\n\n)?(?:<!-- results:[^\n]+\n\n)?((?:^\|.*\n)+)", re.MULTILINE
)
INTERVAL = re.compile(r"\d+(?:\.\d+)?(?: %)? [(\[]\d+(?:\.\d+)?-\d+(?:\.\d+)?")


class Table(NamedTuple):
    """A table of a document, with the expression that gives its cells."""

    keys: tuple[str, ...]
    expression: str
    rows: list[dict[str, str]]


def flat(value: Any) -> list[float]:
    if value is None:
        return []
    return [x for item in value for x in flat(item)] if isinstance(value, list | tuple) else [float(value)]


def evaluated(expression: str, **names: str) -> list[float]:
    return flat(eval(expression, {**FIGURES, **names}))


def mistakes(text: str, values: list[float]) -> list[str]:
    """Return the numbers of a text that are not the values, or what else is wrong."""
    # ranges such as 86-97 are two numbers, not one that is negative
    numbers = NUMBER.findall(re.sub(r"(?<=\d)-(?=\d)", " ", text))
    if len(numbers) != len(values):
        return [f"{len(numbers)} numbers in {text!r} for {values}"]
    wrong = []
    for (below, digits), value in zip(numbers, values, strict=True):
        decimals = len(digits.partition(".")[2])
        bound = float(digits.replace(",", ""))
        if not (value < bound if below else f"{value:.{decimals}f}" == f"{bound:.{decimals}f}"):
            wrong.append(f"{digits} in {text!r} is {value}")
    return wrong


def tables(text: str) -> Iterator[Table]:
    for names, expression, block in TABLE.findall(text):
        heads, _, *rows = [
            [word.strip() for word in line.strip().strip("|").split("|")] for line in block.splitlines()
        ]
        keys = tuple(word.strip() for word in names.split(",") if word)
        yield Table(keys, expression, [dict(zip(heads, row, strict=True)) for row in rows])


def sections(text: str) -> list[tuple[str, str, list[tuple[str, str]]]]:
    """Return (title, visible text on one line, [(words, expression)]) of every section."""
    found = []
    for part in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        held = [
            (words.strip(), expression.strip())
            for comment in COMMENT.findall(part)
            if comment.startswith(" held\n")
            for words, expression in (line.split(":=") for line in comment.strip().splitlines()[1:])
        ]
        visible = " ".join(COMMENT.sub("", part).split())
        found.append((part.splitlines()[0], visible, held))
    return found


HELD = [
    pytest.param(visible, words, expression, id=f"{title}: {words}")
    for text in TEXTS.values()
    for title, visible, held in sections(text)
    for words, expression in held
]


@pytest.mark.parametrize(("visible", "words", "expression"), HELD)
def test_a_number_is_what_the_results_say(visible: str, words: str, expression: str) -> None:
    assert words in visible
    assert not mistakes(words, evaluated(expression))


@pytest.mark.parametrize("name", DOCUMENTS)
def test_every_cell_of_every_table_is_what_the_results_say(name: str) -> None:
    found = list(tables(TEXTS[name]))
    assert found
    for keys, expression, rows in found:
        assert expression, f"a table of {name} has no comment that says where its numbers come from"
        for row in rows:
            named = {key: row[key] for key in keys}
            for column in row.keys() - named.keys():
                values = evaluated(expression, column=column, **named)
                assert not mistakes(row[column], values), f"{named}, {column}"


@pytest.mark.parametrize("name", DOCUMENTS)
def test_no_interval_is_unheld(name: str) -> None:
    for title, visible, held in sections(TEXTS[name]):
        prose = re.sub(r"\|[^|]*(?=\|)", " ", visible)
        for interval in INTERVAL.findall(prose):
            assert any(interval in words for words, _ in held), f"{title}: {interval}"


def test_every_section_that_names_results_holds_a_number_to_them() -> None:
    for title, visible, held in sections(TEXTS["docs/results.md"]):
        assert held or "| " in visible, title


@pytest.mark.parametrize("name", DOCUMENTS)
def test_whatever_names_a_run_of_a_modified_checkout_says_so(name: str) -> None:
    for title, visible, _ in sections(TEXTS[name]):
        for run in MODIFIED:
            if f"benchmarks/results/{run}`" in visible:
                assert "modified checkout" in visible, title


def test_docs_list_all_runs_of_modified_checkouts() -> None:
    (visible,) = (
        text
        for title, text, _ in sections(TEXTS["docs/results.md"])
        if title.startswith("What these results")
    )
    assert set(re.findall(r"`benchmarks/results/([^`]+)`", visible)) == MODIFIED


def test_every_result_folder_is_named() -> None:
    named = set(re.findall(r"benchmarks/results/([\w/.-]*\w)", TEXTS["docs/results.md"]))
    published = {
        path.parent.relative_to(table.RESULTS).as_posix() for path in table.RESULTS.rglob("run.json")
    }
    assert published <= named


@pytest.mark.parametrize(
    ("text", "values", "right"),
    [
        ("92 (89-94)", [92.4, 88.6, 94.49], True),
        ("92 (89-94)", [92.4, 88.4, 94.4], False),
        ("p < 0.001", [0.0009], True),
        ("p < 0.001", [0.001], False),
        ("1,224 episodes of GG-CNN2", [1224.0], True),
        ("7 of 100", [7.0], False),
        ("", [], True),
        ("", [1.0], False),
        ("0.30", [0.302], True),
        ("0.3", [0.36], False),
    ],
)
def test_a_wrong_number_would_be_found(text: str, values: list[float], right: bool) -> None:
    assert (not mistakes(text, values)) is right


@pytest.mark.parametrize("name", DOCUMENTS)
def test_the_generated_tables_are_up_to_date(name: str) -> None:
    inside = TEXTS[name].split(table.BEGIN)[1].split(table.END)[0].strip()
    assert inside == table.table(paper=table.DOCUMENTS[name])


def test_a_cell_that_two_published_runs_have_played_is_refused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(table, "RESULTS", tmp_path)

    def publish(run: str, *controllers: str) -> None:
        rows = [
            grasp_row(suite="thin", detector="oracle", controller=controller) for controller in controllers
        ]
        summary = RunSummary(complete=True, cells=tuple(summarise(map(line_of, rows))), paired_tests=())
        (tmp_path / run).mkdir(exist_ok=True)
        (tmp_path / run / "summary.json").write_text(json.dumps(summary.as_row()))

    publish("a", "mppc")
    publish("b", "mvp")
    assert len(table.cells()) == 2
    publish("b", "mppc")
    with pytest.raises(ConfigError, match=r"two runs have played thin/oracle/mppc; got \['a', 'b'\]"):
        table.table(paper=True)


@pytest.mark.parametrize("baseline", Baseline)
def test_the_report_on_the_paper_says_what_follows_from_the_episodes(baseline: Baseline) -> None:
    runs = ("single-unseen-thin", "single-quoted", "stacks/dhrnet", "stacks/tfgrasp", "stacks/ggcnn")
    lines = [line for run in runs for line in read_lines(published_runs.RESULTS / run).lines]
    findings = evaluate(by_cell(lines), baseline=baseline)
    assert len(findings) == len(published_runs.orderings())
    for verdict, n in count_verdicts(findings).items():
        assert published_runs.verdicts(str(verdict), str(baseline)) == n
