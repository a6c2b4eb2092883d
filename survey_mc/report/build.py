"""Everything a report is made of, in order: tables, figures, the page."""

from __future__ import annotations

from pathlib import Path

from survey_mc.report.figures import field_figures, run_figures
from survey_mc.report.html import report_page
from survey_mc.report.source import FieldPicture, RunSource
from survey_mc.report.tables import WriteFrame, build_tables

PAGE = "index.html"


def build_report(
    source: RunSource,
    out_dir: Path,
    field_picture: FieldPicture | None = None,
    campaign_text: str | None = None,
    write_frame: WriteFrame | None = None,
) -> Path:
    """Write `tables/`, `runs/cpu_seconds.csv` and `report/` (index.html and the figures as PNG) below `out_dir`.

    out_dir: the run directory, or another one. campaign_text: the campaign file as written; None reads
    `out_dir/campaign.toml` if there is one. Returns the path of the page.
    """
    tables = build_tables(source, out_dir, write_frame)
    if campaign_text is None:
        campaign_file = out_dir / "campaign.toml"
        campaign_text = campaign_file.read_text(encoding="utf-8") if campaign_file.is_file() else ""
    figures = run_figures(source, tables)
    pictures = field_figures(field_picture) if field_picture is not None else []
    folder = out_dir / "report"
    folder.mkdir(parents=True, exist_ok=True)
    for figure in (*figures, *pictures):
        _write(folder / f"{figure.name}.png", figure.png)
    page = report_page(source, tables, figures, pictures, campaign_text)
    _write(folder / PAGE, page.encode("utf-8"))
    return folder / PAGE


def _write(path: Path, content: bytes) -> None:
    """Whole or not at all."""
    temporary = path.with_name(f".{path.name}.tmp")
    temporary.write_bytes(content)
    temporary.replace(path)
