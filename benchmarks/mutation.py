"""Do the tests notice? One small change of the code at a time, and the tests of its module.

    pip install cosmic-ray
    python benchmarks/mutation.py --sample 60

A mutant is the code with one operator, number, condition or keyword changed (cosmic-ray: Bingham, "Mutation
testing with Cosmic Ray"). It is killed where a test fails. Changes of type annotations are left out, which no
program can notice. Of each module a random sample is tried, drawn by the seed. All of it happens in a copy of
the project. Survivors are listed with the reason that `mutation_reasons.json` gives, if any.
"""

from __future__ import annotations

import ast
import csv
import importlib.util
import json
import os
import random
import shutil
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from study import (
    RESULTS,
    Parser,
    about,
    error_bars,
    figure,
    kept,
    positive,
    prepare,
    publish,
    rate,
    run_command,
    style,
    track,
)

from mpgrasp.exceptions import ConfigError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parent.parent
OUT = RESULTS / "mutation"
REASONS = Path(__file__).with_name("mutation_reasons.json")
TESTS: Mapping[str, tuple[str, ...]] = {
    "grasp.py": ("test_grasp.py",),
    "statistics.py": ("test_statistics.py",),
    "controllers/grid_map.py": ("controllers/test_grid_map.py", "controllers/test_published_law.py"),
    "controllers/information.py": ("controllers/test_information.py", "controllers/test_published_law.py"),
    "controllers/reaching.py": ("controllers",),
    "controllers/config.py": ("controllers",),
    "controllers/open_loop.py": ("controllers",),
    "episode/seeds.py": ("episode/test_seeds.py",),
    "motion/reflex.py": ("motion/test_reflex.py", "motion/test_arm_driver.py"),
    "bench/results/reader.py": ("bench/results", "bench/commands/test_bench_resume.py"),
    "bench/stored_lines.py": ("bench/test_stored_lines.py", "bench/results/test_bench_writer.py"),
    "bench/results/writer.py": ("bench/results/test_bench_writer.py", "bench/commands/test_bench_resume.py"),
}
"""Modules below mpgrasp/, and what below tests/ must notice a change."""
TIMEOUT = 300.0
"""Wall-clock time after which a mutant counts as killed [s]: it never ends."""


@dataclass(frozen=True, kw_only=True)
class Mutant:
    """One change of a module, and what came of it."""

    module: str
    operator: str
    line: int
    code: str
    """The line as it was."""
    changed: str
    """The line as the change leaves it."""
    killed: bool


def annotated(source: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Begin and end (line, column) of every annotation of a type in a module."""
    spans: list[ast.expr | None] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.arg | ast.AnnAssign):
            spans.append(node.annotation)
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            spans.append(node.returns)
    return [
        ((span.lineno, span.col_offset), (span.end_lineno or 0, span.end_col_offset or 0))
        for span in spans
        if span is not None
    ]


def mutations(path: Path) -> list[Any]:
    """Every mutation of a module (cosmic-ray's work items), in its order, annotations left out."""
    from cosmic_ray.commands.init import init
    from cosmic_ray.work_db import WorkDB, use_db

    spans = annotated(path.read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory() as folder, use_db(f"{folder}/work", WorkDB.Mode.create) as work:
        init([path], work, {})
        every = list(work.work_items)
    return [
        item.mutations[0]
        for item in every
        if not any(low <= tuple(item.mutations[0].start_pos) < high for low, high in spans)
    ]


def chosen(found: Sequence[Any], sample: int, seed: int) -> list[Any]:
    """A random sample of mutations in their order; all of them where there are no more."""
    if len(found) <= sample:
        return list(found)
    return [found[k] for k in sorted(random.Random(seed).sample(range(len(found)), sample))]


def try_out(module: str, mutation: Any, tests: Sequence[str]) -> Mutant:
    """Make one change and run the tests, in a copy of the project that is the current folder."""
    from cosmic_ray.mutating import mutate_and_test

    path = Path("mpgrasp", module)
    before = path.read_text(encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
    words = [*command, *(f"tests/{name}" for name in tests)]
    result = mutate_and_test([mutation], " ".join(words), TIMEOUT)
    changed = [line[1:].strip() for line in (result.diff or "").splitlines() if line[:1] == "+"]
    line = mutation.start_pos[0]
    return Mutant(
        module=module,
        operator=mutation.operator_name.removeprefix("core/"),
        line=line,
        code=before.splitlines()[line - 1].strip(),
        changed=next((text for text in changed if not text.startswith("++")), ""),
        killed=bool(result.is_killed),
    )


def reasons() -> dict[tuple[str, str, str], str]:
    """Reasons of survivors by module, line before and line after."""
    if not REASONS.exists():
        return {}
    rows = json.loads(REASONS.read_text(encoding="utf-8"))
    return {(row["module"], row["code"], row["changed"]): row["reason"] for row in rows}


def copied(folder: Path) -> Path:
    """Copy what tests need of the project, and return the copy's folder."""
    to = folder / "project"
    skip = shutil.ignore_patterns(".git", ".venv", "out", "runs", ".*_cache", "__pycache__")
    shutil.copytree(ROOT, to, ignore=skip)
    return to


def play(modules: Sequence[str], sample: int, seed: int, out: Path) -> Iterator[dict[str, Any]]:
    """A row per mutant of each module; modules that were played before come from `out`/parts."""
    here = Path.cwd()
    with tempfile.TemporaryDirectory(prefix="mpgrasp-mutants-") as folder:
        project = copied(Path(folder))
        os.environ["PYTHONPATH"] = os.pathsep.join([str(project), str(project / "tests")])
        os.chdir(project)
        try:
            for module in modules:
                yield from _of_module(module, sample, seed, here / out)
        finally:
            os.chdir(here)


def _of_module(module: str, sample: int, seed: int, out: Path) -> list[dict[str, Any]]:
    path = Path("mpgrasp", module)
    every = mutations(path)
    some = chosen(every, sample, seed)

    def tried() -> dict[str, Any]:
        rows = [try_out(module, m, TESTS[module]) for m in track(some, module, len(some))]
        return {"all": len(every), "mutants": [vars(row) for row in rows]}

    settings = {"sample": sample, "seed": seed, "source": path.read_text(encoding="utf-8")}
    found = kept(out / "parts" / f"{module.replace('/', '-')}.json", settings, tried)
    return [{**row, "of": found["all"]} for row in found["mutants"]]


def by_module(rows: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Share of killed mutants with its interval, by module and "all"."""
    found: dict[str, dict[str, Any]] = {}
    for module in (*dict.fromkeys(row["module"] for row in rows), "all"):
        of = [row for row in rows if module in ("all", row["module"])]
        found[module] = rate(sum(row["killed"] for row in of), len(of))
    return found


def draw(shares: Mapping[str, Mapping[str, float]]) -> Figure:
    """Shares of killed mutants with their intervals."""
    picture, (axes,) = figure(width=7.5, height=0.4 * len(shares) + 1.4)
    names = list(shares)[::-1]
    heights, bars = error_bars([shares[name] for name in names])
    axes.errorbar(heights, range(len(names)), xerr=bars, linestyle="", capsize=3, **style(0))
    axes.axvline(85, color="black", linewidth=1)
    axes.set(yticks=range(len(names)), yticklabels=names, xlim=(0, 101), xlabel="mutants killed [%]")
    return picture


def _study(command: Sequence[str]) -> None:
    parser = Parser(description=__doc__)
    add = parser.add_argument
    add("--modules", metavar="M[,M]", help="below mpgrasp/ (default: all that the study knows)")
    add("--sample", metavar="N", type=int, default=60, help="mutants of each module (default: %(default)s)")
    add("--seed", metavar="S", type=int, default=0, help="of the sample (default: 0)")
    add("--reasons", action="store_true", help="try nothing; tell today's reasons in the results of --out")
    add("--out", metavar="DIR", type=Path, default=OUT, help="default: benchmarks/results/mutation")
    options = parser.parse_args(command)
    positive("sample", options.sample)
    modules = list(TESTS) if options.modules is None else options.modules.split(",")
    if unknown := [module for module in modules if module not in TESTS]:
        raise ConfigError("unknown modules", got=unknown, allowed=TESTS)
    if not options.reasons and importlib.util.find_spec("cosmic_ray") is None:
        raise ConfigError("cosmic-ray is not installed", allowed="pip install cosmic-ray")
    prepare(options.out)
    if options.reasons:
        told, played = _published(options.out)
    else:
        told = about("mutation", command, sample=options.sample, seed=options.seed, tests=TESTS)
        played = list(play(modules, options.sample, options.seed, options.out))
    why = reasons()  # they may be written while the study lasts: survivors show in `parts/`
    rows = [{**row, "reason": why.get((row["module"], row["code"], row["changed"]), "")} for row in played]
    shares = by_module(rows)
    survivors = [row for row in rows if not row["killed"]]
    publish(options.out, "mutation", told, {"killed": shares, "survivors": survivors}, rows, draw(shares))
    shutil.rmtree(options.out / "parts", ignore_errors=True)
    for name, share in shares.items():
        print(f"{name:<28}{share['count']:4.0f} of {share['n']:4.0f}  {100 * share['rate']:5.1f} %")
    print(f"Survivors without a reason: {sum(not row['reason'] for row in survivors)} of {len(survivors)}")
    print(f"Results: {options.out}")


def _published(out: Path) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Content of run.json and the rows of a finished study."""
    try:
        told = json.loads((out / "run.json").read_text(encoding="utf-8"))
        with (out / "mutation.csv").open(encoding="utf-8", newline="") as file:
            rows: list[dict[str, Any]] = list(csv.DictReader(file))
    except (OSError, ValueError) as error:
        raise ConfigError(f"no finished study there ({error})", got=str(out)) from error
    numbers = ("line", "of")
    return told, [
        {**row, "killed": row["killed"] == "True", **{key: int(row[key]) for key in numbers}} for row in rows
    ]


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code; 2 for unusable input."""
    return run_command(_study, command)


if __name__ == "__main__":
    sys.exit(main())
