"""Fixtures of the tests of simulation."""

import pytest
from helpers.crowd_models import FACTORIES, PACKAGES

from szlib.simulation.crowds.reacting import MODELS
from szlib.simulation.crowds.walking_model import ModelFactory


@pytest.fixture(params=FACTORIES)
def model(request: pytest.FixtureRequest) -> str | ModelFactory:
    """Every model of walking whose package is installed."""
    if request.param == "social force":
        pytest.importorskip("numba")  # the package itself is imported quietly, by szlib
    else:
        pytest.importorskip(PACKAGES[request.param])
    return str(request.param) if request.param in MODELS else FACTORIES[request.param]
