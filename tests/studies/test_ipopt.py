"""IPOPT as a referee: the same runs as szlib, and a control where no plan satisfies the rows."""

import numpy as np
import pytest
from helpers.random_states import PAPER_ZONE, ZONE
from studies import ipopt
from studies.ipopt import ByIpopt

import szlib


@pytest.mark.parametrize("name", szlib.SCENARIOS)
def test_a_run_with_the_papers_settings_is_that_of_szlib(name, monkeypatch):
    scenario, settings = szlib.SCENARIOS[name], szlib.MPCSettings.paper()
    solve, failed = ipopt.solve, []

    def count(*given):
        inputs = solve(*given)
        failed.append(inputs is None)
        return inputs

    monkeypatch.setattr(ipopt, "solve", count)
    szlibs, ipopts = (
        szlib.simulate(
            scenario, make(PAPER_ZONE, walls=scenario.walls, settings=settings)
        ).metrics()
        for make in (szlib.MPCCBF, ByIpopt)
    )
    assert len(failed) > 100 and not any(failed), "IPOPT plans each step itself"
    assert ipopts["time_to_goal"] == szlibs["time_to_goal"]
    assert ipopts["min_h"] == pytest.approx(szlibs["min_h"], abs=1e-4)
    assert ipopts["min_speed"] == pytest.approx(szlibs["min_speed"], abs=1e-3)


def test_where_no_plan_satisfies_the_rows_the_control_is_that_of_szlib():
    """The robot drives at 1 m/s, too near to a person to stop."""
    state, goal, people = (-1.9, 0.0, 1.0, 0.0), (4.0, 0.0), [[0.0, 0.0, 0.0, 0.0]]
    settings = szlib.MPCSettings(time_limit=np.inf)
    step, other = (
        make(ZONE, settings=settings).step(state, goal, people)
        for make in (ByIpopt, szlib.MPCCBF)
    )
    assert not step.feasible and step.status == other.status != "optimal"
    assert np.array_equal(step.inputs, other.inputs)
    assert step.verify().ok
