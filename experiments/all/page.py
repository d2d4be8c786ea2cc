"""Page of all results: for each experiment its figure, command, time and numbers.

The page is generated from summaries. Copies of the summaries and one figure of each experiment are
saved beside it, so the page can be generated again from them.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mjcf_sandbox.files import write_bytes, write_json, write_text

RESULTS, FIGURES = "results", "figures"
FIRST = 4
"""Number of metrics in the overview of an experiment without numbers of the paper."""

HEAD = """# The paper's experiments

`python -m experiments all` generates this page from the summaries in `results/`. Numbers are
medians over robots, with the worst robot in brackets. Robots of seeds 100 and above are for
reporting only; every run on them is recorded in `REPORTED.csv`. Times are for one core. *Seen*
errors compare the estimate with the observation of the camera, as in the paper. *True* errors
compare the target with the true state, which is known in simulation only.
"""


def write_page(summaries: Sequence[Path], names: Sequence[str], out: Path) -> Path:
    """Write ``README.md`` to ``out``, with ``results/`` and ``figures/`` beside it.

    Results of earlier runs beside the page stay on it.

    Args:
        summaries: files ``summary.json``, each with ``figure_1.png`` beside it.
        names: of all experiments, in the order on the page.
        out: folder of the page.
    """
    results = out / RESULTS
    for path in summaries:
        summary = json.loads(path.read_text(encoding="utf-8"))
        write_json(results / f"{summary['name']}.json", summary)
        picture = path.with_name("figure_1.png")
        if picture.is_file():
            write_bytes(out / FIGURES / f"{summary['name']}.png", picture.read_bytes())
    there = [path for name in names if (path := results / f"{name}.json").is_file()]
    page = out / "README.md"
    write_text(page, page_of([json.loads(path.read_text(encoding="utf-8")) for path in there]))
    return page


def page_of(summaries: Sequence[Mapping[str, Any]]) -> str:
    """Text of the page."""
    parts = [HEAD, overview(summaries)]
    parts += [section(summary) for summary in summaries]
    return "\n".join(parts)


def overview(summaries: Sequence[Mapping[str, Any]]) -> str:
    """Table of metrics with a threshold or a number of the paper.

    Experiments without such metrics are listed with their first ones.
    """
    rows = []
    for summary in summaries:
        link = f"[{summary['name']}](#{summary['name']})"
        metrics = summary["metrics"]
        known = {
            name: found
            for name, found in metrics.items()
            if not (found["must"] is None and found["paper"] is None)
        }
        for name, found in (known or dict(list(metrics.items())[:FIRST])).items():
            rows.append(
                [
                    link,
                    summary["figure"],
                    name.replace("_", " "),
                    formatted(found["paper"], found["unit"]),
                    f"**{formatted(found['median'], found['unit'])}** ({found['worst']})",
                    formatted(found["must"], found["unit"]),
                    {True: "yes", False: "**no**", None: ""}[found["reached"]],
                ]
            )
            link = ""
    return table(
        ["experiment", "figure", "number", "paper", "ours (worst)", "must", "reached"], rows
    )


def section(summary: Mapping[str, Any]) -> str:
    """Figure, command, time, all metrics and the first table of an experiment."""
    name = summary["name"]
    rows = [
        [
            key.replace("_", " "),
            found["unit"],
            formatted(found["paper"], ""),
            f"{found['median']}",
            f"{found['low']} to {found['high']}",
            f"{found['worst']}",
            formatted(found["must"], ""),
        ]
        for key, found in summary["metrics"].items()
    ]
    seeds, shown = summary["seeds"], summary["table"]
    robots = f"seed {seeds[0]}" if len(seeds) == 1 else f"seeds {seeds[0]} to {seeds[-1]}"
    return "\n".join(
        [
            f"## {name}",
            "",
            f"{summary['title']}; {summary['figure']} of the paper; {robots}; "
            f"{summary['core_s'] / 60:.1f} minutes of one core.",
            "",
            f"    {summary['command']}",
            "",
            f"![{summary['title']}]({FIGURES}/{name}.png)",
            "",
            table(["", "unit", "paper", "median", "95 % interval", "worst", "must"], rows),
            f"{shown['title']}\n",
            table(shown["head"], shown["rows"]),
            f"{shown['note']}\n",
        ]
    )


def formatted(value: object, unit: str) -> str:
    """A number with its unit, or other text; empty for None."""
    if value is None:
        return ""
    return f"{value} {unit}".strip() if isinstance(value, int | float) else str(value)


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    cells = [[str(cell).replace("|", "\\|") for cell in line] for line in lines]
    return "\n".join(f"| {' | '.join(line)} |" for line in cells) + "\n"
