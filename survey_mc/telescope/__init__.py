"""What the instrument does to the sky: PSF, vignetting, background, field of view; draws photons.

The record a campaign sets stands here; `response.build_response` and `expose.expose` are imported where fields are
drawn, because they load the compiler.
"""

from survey_mc.telescope.instruments import INSTRUMENTS
from survey_mc.telescope.settings import InstrumentSettings

__all__ = ["INSTRUMENTS", "InstrumentSettings"]
