"""Everything a report is made of, in order: tables, figures, the page."""

from __future__ import annotations

from pathlib import Path

from survey_mc.report.field_process import FieldFigures
from survey_mc.report.figures import run_figures
from survey_mc.report.html import report_page
from survey_mc.report.source import RunSource
from survey_mc.report.tables import WriteFrame, build_tables, table_files
from survey_mc.store.digest_list import forget_digests, write_digests
from survey_mc.store.files import write_whole
from survey_mc.store.layout import RunLayout

PAGE = "index.html"


def build_report(
    source: RunSource,
    out_dir: Path,
    pictures: FieldFigures | None = None,
    campaign_text: str | None = None,
    write_frame: WriteFrame | None = None,
) -> Path:
    """Write `tables/`, `runs/cpu_seconds.*`, `report/` (index.html, PNGs) and their `tables.sha256` below `out_dir`.

    out_dir: the run directory, or another one. pictures: of one field. campaign_text: the campaign file as written;
    None reads `out_dir/campaign.toml` if there is one. Returns the path of the page.
    """
    RunLayout(out_dir).refuse_linked_folders()
    tables = build_tables(source, out_dir, write_frame)
    if campaign_text is None:
        campaign_file = out_dir / "campaign.toml"
        campaign_text = campaign_file.read_text(encoding="utf-8") if campaign_file.is_file() else ""
    forget_digests(out_dir)
    figures = run_figures(source, tables)
    pictures = pictures or FieldFigures(())
    folder = out_dir / "report"
    folder.mkdir(parents=True, exist_ok=True)
    for figure in (*figures, *pictures.figures):
        write_whole(folder / f"{figure.name}.png", figure.png)
    page = report_page(source, tables, figures, pictures, campaign_text)
    write_whole(folder / PAGE, page.encode("utf-8"))
    drawn = [folder / f"{figure.name}.png" for figure in (*figures, *pictures.figures)]
    write_digests(out_dir, [*table_files(out_dir), *drawn, folder / PAGE])
    return folder / PAGE
