"""A package with entry points, installed without an installer: its files on a path, and what pip would write."""

from __future__ import annotations

from pathlib import Path

METADATA = "Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n"


def install(
    folder: Path, files: dict[str, str], offers: dict[str, str], name: str = "tophat-detector", version: str = "0.1"
) -> None:
    """Put modules and the metadata of a distribution into a folder; offers: entry points of our group."""
    for file, text in files.items():
        (folder / file).write_text(text)
    info = folder / f"{name.replace('-', '_')}-{version}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(METADATA.format(name=name, version=version))
    lines = [f"{offer} = {value}" for offer, value in offers.items()]
    (info / "entry_points.txt").write_text("\n".join(["[survey_mc.detectors]", *lines, ""]))
