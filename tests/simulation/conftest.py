"""Fixtures of the tests of simulation."""

import pytest
from helpers.crowd_models import PACKAGES

from szlib.simulation.crowds.reacting import MODELS


@pytest.fixture(params=MODELS)
def model(request: pytest.FixtureRequest) -> str:
    """Every model of walking whose package is installed."""
    if request.param == "social force":
        pytest.importorskip("numba")  # the package itself is imported quietly, by szlib
    else:
        pytest.importorskip(PACKAGES[request.param])
    return str(request.param)
