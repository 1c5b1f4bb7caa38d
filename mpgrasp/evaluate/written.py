"""Results of an evaluation on paper: the table, and the files in --out."""

from __future__ import annotations

import base64
import csv
import dataclasses
import io
import json
from argparse import Namespace
from collections.abc import Mapping, Sequence
from importlib.resources import files

from markupsafe import Markup

from mpgrasp.bench.report.names import name_of_player
from mpgrasp.bench.results.provenance import provenance
from mpgrasp.detectors.detector import GraspDetector
from mpgrasp.evaluate.paper import TABLE_II
from mpgrasp.evaluate.scores import TOP, ImageScore, fold_spread, paired_tests, rates
from mpgrasp.evaluate.scoring import Scored
from mpgrasp.evaluate.sheets import png, prediction_sheet, worst_sheet
from mpgrasp.exceptions import OutputError
from mpgrasp.files.atomic import replace_file
from mpgrasp.files.json_values import json_value

Rows = list[tuple[str, ...]]


def results_table(scored: Scored, options: Namespace) -> Rows:
    """Return the table of results, its headings first; beside what was trained, the paper's figures."""
    rows = scored.rows
    folds = any(row.fold is not None for row in rows)
    paper = options.dataset == "cornell" and options.train
    table: Rows = [
        (
            "detector", "best right %", f"one of {TOP} right %", "at the border %",
            *(("mean ± SD of folds %",) if folds else ()), *(("paper %",) if paper else ()),
        )
    ]  # fmt: skip
    for name in dict.fromkeys(row.detector for row in rows):
        found, spread = rates(rows, name), fold_spread(rows, name)
        cells = [str(rate) if rate.n else "-" for rate in found.values()]
        if folds:
            mean, deviation = spread or (0.0, 0.0)
            cells.append(f"{100 * mean:.1f} ± {100 * deviation:.1f}" if spread else "-")
        if paper:
            cells.append(_paper(name, options))
        table.append((name, *cells))
    return table


def _paper(detector: str, options: Namespace) -> str:
    channels = options.channels or "d"
    for row in TABLE_II:
        if row.method == name_of_player(detector) and row.channels == channels:
            value = row.iw if options.split == "iw" else row.ow
            return "-" if value is None else f"{value:g}"
    return "-"


def summary_lines(scored: Scored, title: str) -> list[str]:
    """Return sentences about what was scored: images, units, what was left out, paired tests."""
    unit = " and ".join(sorted(scored.units)) or "-"
    images = "1 image" if scored.images == 1 else f"{scored.images} images"
    lines = [f"{title}: {images}, depth stored in {unit}; {scored.skipped}"]
    without = len({row.image for row in scored.rows if not row.labelled})
    if without:
        unlabelled = "1 image has" if without == 1 else f"{without} images have"
        lines.append(f"{unlabelled} no label: only the border's rate counts such images")
    lines += [
        f"{test.a} and {test.b}: alone {test.a_alone} and {test.b_alone}, Holm p {test.p_holm:.3g}"
        for test in paired_tests(scored.rows)
    ]
    return lines


def write_results(
    options: Namespace,
    command: str,
    scored: Scored,
    detectors: Mapping[str, GraspDetector],
    title: str,
) -> None:
    """Write all files of an evaluation.

    Raises:
        OutputError: they cannot be written.
    """
    names = list(dict.fromkeys(row.detector for row in scored.rows))
    told = {
        "command": command,
        "dataset": options.dataset,
        "rates": {
            name: {
                key: {"count": rate.count, "n": rate.n, "interval": rate.interval}
                for key, rate in rates(scored.rows, name).items()
            }
            for name in names
        },
        "folds": {name: fold_spread(scored.rows, name) for name in names},
        "paired_tests": [dataclasses.asdict(test) for test in paired_tests(scored.rows)],
        "skipped": scored.skipped.reasons,
        "made_with": provenance(),
    }
    pictures = {"predictions": png(prediction_sheet(scored.shown, detectors))}
    if scored.worst:
        pictures["worst"] = png(worst_sheet(scored.worst))
    page = _page(title, command, results_table(scored, options), summary_lines(scored, title), pictures)
    fold_list = {row.image: row.fold for row in scored.rows if row.fold is not None}
    try:
        options.out.mkdir(parents=True, exist_ok=True)
        replace_file(options.out / "evaluation.json", json.dumps(json_value(told), indent=1) + "\n")
        replace_file(options.out / "images.csv", _csv(scored.rows))
        if fold_list:
            replace_file(options.out / "folds.json", json.dumps(fold_list, indent=0, sort_keys=True) + "\n")
        for name, picture in pictures.items():
            replace_file(options.out / f"{name}.png", picture)
        replace_file(options.out / "report.html", page)
    except OSError as error:
        raise OutputError(f"results cannot be written: {error}", got=str(options.out)) from error


def _csv(rows: Sequence[ImageScore]) -> str:
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, [field.name for field in dataclasses.fields(ImageScore)])
    writer.writeheader()
    writer.writerows(dataclasses.asdict(row) for row in rows)
    return text.getvalue()


def _page(title: str, command: str, table: Rows, lines: Sequence[str], pictures: Mapping[str, bytes]) -> str:
    """Return one HTML page that needs nothing else."""
    style = files("mpgrasp.bench.report").joinpath("templates", "style.css").read_text(encoding="utf-8")
    heading, *body = table
    cells = [
        Markup("").join(
            Markup('<td data-label="{}">{}</td>').format(title, cell)
            for title, cell in zip(heading, row, strict=True)
        )
        for row in body
    ]
    captions = {
        "predictions": "Predictions. Of each image: the labels and the best five grasps of every detector "
        "(blue, orange, green, red, purple); below, depth, and quality, angle and width.",
        "worst": "Images that went worst, with their labels.",
    }
    figures = Markup("").join(
        Markup(
            '<figure><img alt="{0}" src="data:image/png;base64,{1}"><figcaption>{0}</figcaption></figure>'
        ).format(captions[name], base64.b64encode(picture).decode())
        for name, picture in pictures.items()
    )
    return Markup(
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        "<style>{style}\nimg {{ max-width: 100%; }}</style></head>\n<body><main><h1>{title}</h1>\n{lines}\n"
        "<table><thead><tr>{heading}</tr></thead><tbody>{body}</tbody></table>\n{figures}\n"
        "<p>Made by <code>{command}</code></p></main></body></html>\n"
    ).format(
        title=title,
        style=Markup(style),
        lines=Markup("").join(Markup("<p>{}</p>").format(line) for line in lines),
        heading=Markup("").join(Markup("<th>{}</th>").format(cell) for cell in heading),
        body=Markup("").join(Markup("<tr>{}</tr>").format(row) for row in cells),
        figures=figures,
        command=command,
    )
