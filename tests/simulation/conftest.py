"""Fixtures of the tests of simulation."""

import pytest
from helpers.crowd_models import FACTORIES, PACKAGES

from szlib.simulation.crowds import WALKING_MODELS


@pytest.fixture(params=FACTORIES)
def model(request):
    """Every model of walking whose package, if it needs one, is installed."""
    if request.param in PACKAGES:
        pytest.importorskip(PACKAGES[request.param])
    return (
        str(request.param)
        if request.param in WALKING_MODELS
        else FACTORIES[request.param]
    )
