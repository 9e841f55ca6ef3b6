"""A work-precision measurement as Markdown, CSV and JSON."""

from __future__ import annotations

import csv
import io
import json
from typing import Any

import numpy as np

from ..quoting import csv_cell, markdown
from .measuring import Timing
from .trading import TARGETS, Row, Trade, again, whole

__all__ = ["as_csv", "as_json", "as_markdown", "markdown_table"]

COLUMNS = (
    "setting",
    "error",
    "estimate",
    "whole",
    "whole low",
    "whole high",
    "runs",
    "model",
    "solve",
    "first",
    "again",
    "again low",
    "again high",
    "memory",
    "elements",
    "unknowns",
    "iterations",
    "steps",
    "status",
    "remark",
)
"""Seconds and MB."""

HEADS = (
    "setting",
    "error",
    "estimate",
    "whole",
    "spread",
    "model",
    "solve",
    "first",
    "again",
    "memory",
    "unknowns",
    "iterations",
    "remark",
)


def _values(row: Row) -> dict[str, Any]:
    found, spread = row.measurement, row.measurement.whole or Timing(np.nan, np.nan, np.nan, 0)
    repeated = found.again or Timing(np.nan, np.nan, np.nan, 0)
    numbers = (
        row.error,
        found.estimate,
        row.seconds,
        spread.low,
        spread.high,
        spread.runs,
        found.model,
        found.solve,
        found.first,
        repeated.median,
        repeated.low,
        repeated.high,
        found.memory,
    )
    counts = (found.elements, found.unknowns, found.iterations, found.steps)
    return dict(zip(COLUMNS, (row.name, *map(_finite, numbers), *counts, found.status, row.remark), strict=True))


def _finite(value: float | None) -> float | None:
    return value if value is not None and np.isfinite(value) else None


def as_json(trade: Trade) -> str:
    """Everything: machine, reference, rows, peers, fronts (by their settings), advice."""
    answer = {
        "title": trade.scene.title,
        "machine": trade.machine,
        "errors": {"of": trade.kind, "against": trade.against, "reference_estimate": trade.reference.estimate},
        "settings": [_values(row) for row in trade.rows],
        "front": {
            "whole": [row.name for row in trade.front(whole)],
            "again": [row.name for row in trade.front(again)],
        },
        "peers": [
            {"label": p.label, "error": _finite(p.error), "seconds": p.seconds, "again": p.again} for p in trade.peers
        ],
        "advice": trade.advice,
        "notes": list(trade.notes),
    }
    return json.dumps(answer, allow_nan=False, indent=1) + "\n"


def as_csv(trade: Trade) -> str:
    """One line for each setting."""
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    for row in trade.rows:
        writer.writerow({key: csv_cell(value) for key, value in _values(row).items()})
    return text.getvalue()


def as_markdown(trade: Trade, *, every: bool = True) -> str:
    """Machine, reference, advice and a table: of every setting, or of the fronts and of what the library chose."""
    rows = list(trade.rows)
    if not every:
        kept = {row.name for cost in (whole, again) for row in trade.front(cost)}
        rows = [row for row in rows if row.name in kept or row.measurement.variant.chosen]
    estimate = trade.reference.estimate
    against = "what the file expects" if trade.against == "file" else _reference(trade, estimate)
    lines = [
        f"# Accuracy against time: {markdown(trade.scene.title) or 'untitled scene'}",
        "",
        "; ".join(f"{key} {value}" for key, value in trade.machine.items()),
        "",
        f"Errors are of the {trade.kind}, relative, against {against}.",
        "",
        trade.advice,
        "",
        *(line for line in (trade.verdict(target) for target in TARGETS) if line),
        *trade.notes,
        "",
        "whole: a run with branch check and error bar, once everything is loaded (spread: quartiles), of it model and "
        "solve; first: the first one in a new process; again: a repeated solve alone, on one mesh, without either.",
        "",
        *markdown_table(
            HEADS,
            [_cells(row) for row in sorted(rows, key=lambda row: (not row.measurement.variant.chosen, row.seconds))],
        ),
    ]
    if trade.peers:
        lines += ["", *markdown_table(("peer", "error", "command", "again"), [_peer_cells(p) for p in trade.peers])]
    return "\n".join(lines) + "\n"


def _reference(trade: Trade, estimate: float | None) -> str:
    estimated = "not estimated" if estimate is None else f"estimated error {estimate:.1e}"
    return f"an own solution with {trade.reference.variant.name} ({estimated})"


def markdown_table(heads: tuple[str, ...], rows: list[tuple[str, ...]]) -> list[str]:
    """Lines of a table in Markdown, columns as wide as their widest cell."""
    widths = [max(len(cell) for cell in column) for column in zip(heads, *rows, strict=True)]

    def line(cells: tuple[str, ...]) -> str:
        return "| " + " | ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True)) + " |"

    return [line(heads), "|" + "|".join("-" * (width + 2) for width in widths) + "|", *map(line, rows)]


def _seconds(value: float | None) -> str:
    if value is None or not np.isfinite(value):
        return ""
    return f"{1e3 * value:.2f} ms" if value < 1.0 else f"{value:.2f} s"


def _number(value: float | None) -> str:
    return "" if value is None or not np.isfinite(value) else f"{value:.1e}"


def _cells(row: Row) -> tuple[str, ...]:
    found = row.measurement
    spread = "" if found.whole is None else f"{_seconds(found.whole.low)} to {_seconds(found.whole.high)}"
    return (
        row.name,
        _number(row.error),
        _number(found.estimate),
        _seconds(row.seconds),
        spread,
        _seconds(found.model),
        _seconds(found.solve),
        _seconds(found.first),
        _seconds(row.again),
        "" if found.memory is None else f"{found.memory:.0f} MB",
        str(found.unknowns or ""),
        str(found.iterations or found.steps or ""),
        row.remark,
    )


def _peer_cells(peer: Any) -> tuple[str, ...]:
    return markdown(peer.label), _number(peer.error), _seconds(peer.seconds), _seconds(peer.again)
