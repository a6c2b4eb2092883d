import numpy as np
import pytest
from match_fields import detection_frame, field_of, photons_of, truth_frame


@pytest.fixture
def simple_field():
    """Three sources of 50, 40 and 5 counts and a detection on each, one in the void."""
    truth = truth_frame([20.0, 40.0, 20.0], [20.0, 40.0, 45.0], [50, 40, 5])
    photons = photons_of(truth, np.random.default_rng(3), n_background=100)
    return field_of(truth, photons), detection_frame([20.1, 40.1, 20.2, 50.0], [20.0, 40.1, 45.0, 10.0])
