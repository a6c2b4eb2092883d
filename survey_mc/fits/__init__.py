"""FITS images in, catalogues, regions and simulated fields out; astropy is imported only when a function is called."""

from survey_mc.fits.catalogue import Catalogue, read_catalogue, write_catalogue
from survey_mc.fits.header import ImageFacts
from survey_mc.fits.image import CountsImage, read_counts_image
from survey_mc.fits.maps import read_background_map, read_exposure_map, read_sky_image
from survey_mc.fits.observation import FileObservation, observation_from_files
from survey_mc.fits.regions import Region, read_regions, write_regions
from survey_mc.fits.simulated import write_simulated_field
from survey_mc.fits.wcs import fits_from_pix, icrs_deg, pix_from_fits

__all__ = [
    "Catalogue",
    "CountsImage",
    "FileObservation",
    "ImageFacts",
    "Region",
    "fits_from_pix",
    "icrs_deg",
    "observation_from_files",
    "pix_from_fits",
    "read_background_map",
    "read_catalogue",
    "read_counts_image",
    "read_exposure_map",
    "read_regions",
    "read_sky_image",
    "write_catalogue",
    "write_regions",
    "write_simulated_field",
]
