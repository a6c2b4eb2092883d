"""The verb that takes a real image: detect."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import click

from survey_mc.cli.options import PATH, refuse_overwriting
from survey_mc.errors import BadInput


def parse_settings(settings: tuple[str, ...]) -> dict[str, Any]:
    """Parameters from key=value texts; values are TOML, a bare word is a text."""
    found: dict[str, Any] = {}
    for setting in settings:
        key, equals, value = setting.partition("=")
        if not equals or not key.strip().isidentifier():
            raise BadInput("--set", f"must be key=value (got {setting[:60]!r})")
        if key.strip() in found:
            raise BadInput("--set", f"{key.strip()} is given twice")
        found[key.strip()] = _value(value.strip())
    return found


def _value(text: str) -> Any:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (tomllib.TOMLDecodeError, ValueError, RecursionError):
        return text


@click.command()
@click.argument("image", type=PATH, metavar="IMAGE.fits")
@click.option(
    "--method", default="mr1_se", show_default=True, metavar="NAME", help="Procedure, see `survey-mc show methods`."
)
@click.option(
    "--profile", default="paper", show_default=True, metavar="NAME", help="Named set of parameters to start from."
)
@click.option(
    "--set", "settings", multiple=True, metavar="KEY=VALUE", help="A parameter of the procedure; may be repeated."
)
@click.option("--exposure", type=PATH, metavar="FILE", help="Exposure map (s, vignetted); 0 means not observed.")
@click.option(
    "--background", type=PATH, metavar="FILE", help="Background map; its BUNIT says per pixel or per arcmin²."
)
@click.option(
    "--exposure-s", type=float, metavar="S", help="Exposure time where there is no map and no header keyword."
)
@click.option("--flux-per-rate", type=float, metavar="F", help="erg/cm²/s of one ct/s on axis, for the flux columns.")
@click.option("--pixel-scale", type=float, metavar="ARCSEC", help="Side of a pixel where the header has no WCS.")
@click.option("--psf-fwhm", type=float, default=6.0, show_default=True, metavar="ARCSEC", help="FWHM of the PSF.")
@click.option(
    "--psf-hew", type=float, default=15.0, show_default=True, metavar="ARCSEC", help="Half-energy width of the PSF."
)
@click.option("--out", type=PATH, required=True, metavar="CATALOGUE.fits", help="FITS catalogue to write.")
@click.option("--regions", type=PATH, metavar="FILE.reg", help="DS9 region file.  [default: beside the catalogue]")
@click.option("--overwrite", is_flag=True, help="Replace files that exist.")
def detect(
    image: Path,
    method: str,
    profile: str,
    settings: tuple[str, ...],
    exposure: Path | None,
    background: Path | None,
    exposure_s: float | None,
    flux_per_rate: float | None,
    pixel_scale: float | None,
    psf_fwhm: float,
    psf_hew: float,
    out: Path,
    regions: Path | None,
    overwrite: bool,
) -> None:
    """Detect sources on a FITS counts image; write a FITS catalogue and a DS9 region file.

    \b
    Example:
      survey-mc detect field.fits --method mr1_se --exposure expmap.fits --set significance=1e-3 --out field_cat.fits
    """
    from survey_mc.fits import write_catalogue, write_regions
    from survey_mc.fits.writing import check_target
    from survey_mc.run import detect_image

    region_file = regions or out.with_suffix(".reg")
    refuse_overwriting((out, region_file), (image, exposure, background))
    for target in (out, region_file):
        check_target(target, overwrite)
    found = detect_image(
        image,
        method,
        parse_settings(settings),
        profile=profile,
        psf_fwhm_arcsec=psf_fwhm,
        psf_hew_arcsec=psf_hew,
        exposure_path=exposure,
        background_path=background,
        exposure_s=exposure_s,
        flux_per_rate_cgs=flux_per_rate,
        pixel_scale_arcsec=pixel_scale,
    )
    for note in found.notes:
        click.echo(f"note: {note}", err=True)
    observation = found.source.observation
    write_catalogue(
        out,
        found.detections,
        detector=found.detector,
        params=found.params,
        observation=observation,
        facts=found.source.facts,
        overwrite=overwrite,
    )
    title = f"{found.detector.label} on {image.name}"
    write_regions(region_file, found.detections, observation, title=title, overwrite=overwrite)
    click.echo(f"{out}: {len(found.detections)} detections with {found.detector.label}; regions in {region_file}")


IMAGE_VERBS = (detect,)
