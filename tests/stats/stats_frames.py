"""Match rows made by hand for the tests of statistics."""

import numpy as np
import pandas as pd

from survey_mc.columns import MATCHES

DEFAULTS = {"rule": "nearest", "kind_true": "point", "source_id": 0, "det_id": 0, "realisation": 0, "is_blend": False}


def match_rows(n, **values):
    """n rows with the given columns; NaN, 0 or the defaults elsewhere."""
    columns = {}
    for column in MATCHES.columns:
        value = values.get(column.name, DEFAULTS.get(column.name, 0 if column.dtype == "int32" else np.nan))
        columns[column.name] = np.broadcast_to(np.asarray(value), n)
    return pd.DataFrame(columns)
