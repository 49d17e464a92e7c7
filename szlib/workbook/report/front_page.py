"""The front page of a report, from what a run left in its folder: files, records, executed notebooks."""

from __future__ import annotations

import io
import json
import re
from base64 import b64encode
from collections.abc import Iterator, Mapping
from html import escape
from pathlib import Path
from typing import Any

import nbformat
import pandas as pd
from bs4 import BeautifulSoup

from ...control.settings import MPCSettings
from ...errors import ZoneError
from ...plaza.settings import PlazaSettings
from ...simulation.scenarios.paper import SCENARIOS
from ...tracks import datasets, funnels
from ...zones.social_zone import SocialZone
from ..record.tables import as_text

Notebooks = Mapping[str, Any]
"""Executed notebooks by their names, in order."""
NOT_HERE = "*Not made in this run.*"


def cells(home: Path, notebooks: Notebooks) -> list[Any]:
    """The cells of the front page."""
    summary, made = _read(home / "summary.json"), _read(home / "parameters.json")
    records: dict[str, Any] = summary.get("notebooks", {})
    page = [_markdown(f"# szlib: what came of {summary.get('data', home.name)}"), *_run(home, made, records)]
    page += [_markdown("## The notebooks"), _table(_contents(notebooks, records))]
    page += [_markdown("## From rows to encounters"), *_funnel(home)]
    page += [_markdown("## The social zone"), *_zone(home)]
    page += [_markdown("## What the paper claims, and what came out"), *_claims(records)]
    page += [_markdown("## The four scenarios"), *_players(notebooks)]
    return [*page, _markdown("## Parameters, and where each comes from"), *_parameters(notebooks)]


def _run(home: Path, made: Mapping[str, Any], records: Mapping[str, Any]) -> Iterator[Any]:
    checks = [(name, c) for name, r in records.items() for c in r["checks"] if c["kind"] == "check"]
    failed = [f"{name}: {c['name']} ({as_text(c['value'])})" for name, c in checks if not c["passed"]]
    broken = [
        f"{name}: {r.get('error', r['status'])}" for name, r in records.items() if r["status"] != "done"
    ]
    said = f"{len(checks) - len(failed)} of {len(checks)} checks hold."
    seen = [c["passed"] for r in records.values() for c in r["checks"] if c["kind"] == "observation"]
    if seen:
        said += f" Of {len(seen)} that were made for the default parameters, {sum(seen)} hold here as well."
    yield _markdown("\n".join([f"**{said}**", *(f"\n- {escape(each)}" for each in failed + broken)]))
    area = home / "area.txt"
    given = made.get("parameters", {})
    rows = {
        "data": ", ".join(f"{name} ({size:,} bytes)" for name, size, *_ in made.get("files", [])),
        "area": area.read_text(encoding="utf-8") if area.exists() else "",
        "other than the default parameters": ", ".join(f"{k} = {v}" for k, v in given.items()) or "none",
        "szlib": made.get("szlib", ""),
    }
    yield _table(pd.DataFrame([(k, escape(str(v))) for k, v in rows.items() if v], columns=["", " "]))


def _contents(notebooks: Notebooks, records: Mapping[str, Any]) -> pd.DataFrame:
    rows = []
    for name, notebook in notebooks.items():
        record = records.get(name, {"checks": [], "status": "", "seconds": None})
        checks = [c["passed"] for c in record["checks"] if c["kind"] == "check"]
        question = re.search(r"\*\*Question\.\*\*(.*?)(\n\n|\*\*|$)", notebook.cells[0].source, re.DOTALL)
        seconds = "" if record["seconds"] is None else f"{record['seconds']:.0f}"
        asked = " ".join(question[1].replace("*", "").split()) if question else ""
        link = f'<a href="#{name}">{name.replace("_", " ")}</a>'
        rows.append((link, escape(asked), f"{sum(checks)}/{len(checks)}", seconds, record["status"]))
    return pd.DataFrame(rows, columns=["notebook", "question", "checks", "seconds", "status"])


def _funnel(home: Path) -> Iterator[Any]:
    file = home / "encounters.parquet"
    if not file.exists():
        yield _markdown(NOT_HERE)
        return
    table = funnels.table(funnels.get(pd.read_parquet(file)))
    table["stage"] = table["stage"].where(~table["stage"].duplicated(), "")
    table["rows"] = [f"{rows:,}" for rows in table["rows"]]
    yield _table(table)


def _zone(home: Path) -> Iterator[Any]:
    try:
        zone = SocialZone.load(home / "zone.json")
    except (OSError, ZoneError):
        yield _markdown(NOT_HERE)
        return
    speed = MPCSettings().zone_speed
    synthetic = _read(home / "parameters.json").get("data") == datasets.SYNTHETIC
    if speed in zone.ellipses:
        yield _picture(zone, speed, PlazaSettings().true_zone(speed) if synthetic else None)
    table = zone.table()
    bounds = [f"{name}{end}" for name in ("a", "b") for end in ("", "_low", "_high")]
    shown = [c for c in ("speed", "center_x", *bounds, "encounters", "adequate") if c in table]
    yield _markdown(f"By `{zone.method}`, with 95 % intervals [m]; `adequate`: enough people on every side.")
    yield _table(table[shown].round(2))


def _picture(zone: SocialZone, speed: float, truth: Any) -> Any:
    from matplotlib.figure import Figure

    from .. import figures

    figure = Figure(figsize=(6, 4.5), layout="constrained")
    figures.plot_zone(zone, speed, truth=truth, ax=figure.subplots())
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=100)
    alt = escape(figures.alt_text(figure), quote=True)
    return _html(f'<img src="data:image/png;base64,{b64encode(content.getvalue()).decode()}" alt="{alt}">')


def _claims(records: Mapping[str, Any]) -> Iterator[Any]:
    rows = [
        (
            f'<a href="#{name}">{name.split("_")[0]}</a>',
            *(escape(as_text(c[k])) for k in ("name", "result", "value")),
        )
        for name, record in records.items()
        for c in record["checks"]
        if c["kind"] == "claim"
    ]
    table = pd.DataFrame(rows, columns=["notebook", "claim", "verdict", "effect, or what was found"])
    yield _table(table) if rows else _markdown(NOT_HERE)


def _players(notebooks: Notebooks) -> Iterator[Any]:
    pages = [html for notebook in notebooks.values() for html in _outputs(notebook) if "szlib-player" in html]
    for scenario in SCENARIOS.values():
        found = next((page for page in pages if f'alt="{scenario.title}:' in page), None)
        yield _markdown(f"**{scenario.title}**" + ("" if found else f"\n\n{NOT_HERE}"))
        if found:
            yield _html(found)


def _parameters(notebooks: Notebooks) -> Iterator[Any]:
    rows = []
    for name, notebook in notebooks.items():
        for html in _outputs(notebook):
            for shown in BeautifulSoup(html, "html.parser").select("table") if ">badge<" in html else ():
                head = [th.get_text(strip=True) for th in shown.select("thead th")]
                if head == ["parameter", "value", "badge", "why"]:
                    link = f'<a href="#{name}">{name[:2]}</a>'
                    body = [tr.select("td") for tr in shown.select("tbody tr")]
                    rows += [(link, *(escape(td.get_text(strip=True)) for td in row)) for row in body]
    table = pd.DataFrame(rows, columns=["notebook", "parameter", "value", "badge", "why"])
    table = table.drop_duplicates(["parameter", "value", "badge", "why"])
    yield _table(table) if rows else _markdown(NOT_HERE)


def _outputs(notebook: Any) -> Iterator[str]:
    """The HTML of every output."""
    for cell in notebook.cells:
        for output in cell.get("outputs", ()):
            html = output.get("data", {}).get("text/html", "")
            yield html if isinstance(html, str) else "".join(html)


def _read(file: Path) -> dict[str, Any]:
    """What a run left, or nothing where it left none."""
    return dict(json.loads(file.read_text(encoding="utf-8"))) if file.exists() else {}


def _markdown(text: str) -> Any:
    return nbformat.v4.new_markdown_cell(text)


def _html(html: str) -> Any:
    output = nbformat.v4.new_output("display_data", {"text/html": html})
    return nbformat.v4.new_code_cell("", outputs=[output])


def _table(table: pd.DataFrame) -> Any:
    """A table whose cells are HTML already."""
    with pd.option_context("display.max_colwidth", None):
        return _html(table.to_html(index=False, escape=False, border=0, justify="left", classes="front"))
