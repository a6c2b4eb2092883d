"""The instruments a campaign can name."""

from survey_mc.registry import Registry
from survey_mc.telescope.instruments import chandra_acis, rosat_hri, xmm_epic
from survey_mc.telescope.instruments.instrument import Instrument, InstrumentBand

INSTRUMENTS: Registry[Instrument] = Registry(
    "instrument",
    [
        xmm_epic.INSTRUMENT,
        rosat_hri.INSTRUMENT,
        chandra_acis.INSTRUMENT,
    ],
)

__all__ = ["INSTRUMENTS", "Instrument", "InstrumentBand"]
