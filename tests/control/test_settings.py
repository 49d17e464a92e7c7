"""Settings: their ranges, the source of each default, and the three sets that users choose from."""

from __future__ import annotations

import inspect
import re
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

import szlib


@pytest.mark.parametrize(
    "change",
    [
        {"gamma": 0.0}, {"gamma": 1.01}, {"gamma": np.nan}, {"gamma": "0.1"}, {"dt": 0.0}, {"N": 0},
        {"N": 8.0}, {"N_h": 9}, {"N_h": 0}, {"Q": (1, 1, 1)}, {"Q": (-1, 1, 1, 1)}, {"P": (1, 1, 1, np.nan)},
        {"R": (0, 1)}, {"N_h": 2.5}, {"a_max": -1}, {"v_max": np.inf}, {"r_robot": -0.1}, {"eps": -1},
        {"zone_speed": 0}, {"head_on_share": 0.6}, {"head_on_share": -0.1}, {"a_max": 0}, {"pass_side": "up"},
        {"R": (-1, 1)}, {"terminal": "wall"}, {"grid": (1.0, 1.5)}, {"grid": "abc"}, {"guard": "no"},
        {"terminal": ["rest"]}, {"terminal": "person"}, {"decay_price": 0.0}, {"decay_price": np.nan},
        {"decay_price": "high"}, {"body_gap": -0.1}, {"jerk_weight": -1.0}, {"lookahead": 0.0},
        {"lookahead": "4"}, {"deadline": 0}, {"grid": (2, 1)}, {"grid": (1, 0)},
        {"grid": (1, 2), "terminal": "rest"}, {"max_iterations": 0}, {"time_limit": 0},
        {"time_limit": np.nan}, {"time_limit": "1"}, {"margin": "none"}, {"v_max": 1e155},
    ],
)  # fmt: skip
def test_a_setting_out_of_its_range_is_named_in_the_error(change: Any) -> None:
    with pytest.raises(szlib.SolverError, match=f"^{next(iter(change))} must"):
        szlib.MPCSettings(**change)


def test_settings_may_lie_at_the_ends_of_their_ranges() -> None:
    zeros = {
        "r_robot": 0.0,
        "eps": 0.0,
        "Q": (0.0,) * 4,
        "P": (0.0,) * 4,
        "head_on_share": 0.0,
    }
    for change in (
        zeros,
        {"gamma": 1.0, "N_h": 8, "head_on_share": 0.5},
        {"N": 1, "N_h": 1},
    ):
        settings = szlib.MPCSettings(**change)
        assert {name: getattr(settings, name) for name in change} == change


def test_every_setting_is_documented() -> None:
    listed = str(inspect.getdoc(szlib.MPCSettings)).split("Raises")[0]
    for each in fields(szlib.MPCSettings):
        entry = rf"^(\w+, )*{each.name}(, \w+)* : "
        assert re.search(entry, listed, re.MULTILINE), each.name


def test_the_papers_settings_have_5_cm_no_rule_of_the_side_and_no_guard() -> None:
    paper, ours = szlib.MPCSettings.paper(), szlib.MPCSettings()
    differing = {
        f.name for f in fields(paper) if getattr(paper, f.name) != getattr(ours, f.name)
    }
    assert differing == {"margin", "head_on_share", "time_limit", "guard"}
    assert (paper.dt, paper.N, paper.N_h, paper.eps, paper.v_max, paper.r_robot) == (
        0.1,
        8,
        2,
        0.05,
        1.0,
        0.5,
    )
    assert (paper.margin, paper.head_on_share, paper.guard) == ("paper", 0.0, False)
    assert szlib.MPCSettings.paper(gamma=0.1) == replace(paper, gamma=0.1)
    with pytest.raises(szlib.SolverError, match="gamma must"):
        szlib.MPCSettings.paper(gamma=2)


def test_what_the_paper_does_not_give_is_assumed() -> None:
    s = szlib.MPCSettings.paper()
    assert (s.gamma, s.a_max, s.R) == (0.05, 1.0, (1.0, 1.0))
    assert (s.Q, s.P) == ((10.0, 10.0, 1.0, 1.0), (100.0, 100.0, 10.0, 10.0))


def test_the_settings_among_people_look_3_s_ahead_and_have_a_price_of_decay() -> None:
    s = szlib.MPCSettings.among_people()
    assert (s.gamma, s.jerk_weight, s.body_gap) == (0.1, 6.0, 0.2)
    assert s.decay_price < s.zone_price < np.inf
    assert s.times[-1] == pytest.approx(3.0) and (s.N, s.N_h) == (14, 14)
    assert s.lookahead == pytest.approx(4.0) and 0 < s.decay_price < np.inf
    fast = szlib.MPCSettings.among_people(v_max=1.5, dt=0.05)
    assert fast.lookahead == pytest.approx(1.5 * 1.5 + 1.0)
    assert szlib.MPCSettings.among_people(lookahead=2.0).lookahead == 2.0
    for plan in ({"grid": (1,) * 8}, {"grid": (), "N": 8}):
        near = szlib.MPCSettings.among_people(**plan)
        assert near.lookahead == pytest.approx(1.0 + near.times[-1] * near.v_max)


def test_a_terminal_condition_and_a_grid_have_barriers_on_the_whole_horizon() -> None:
    assert szlib.MPCSettings(terminal="rest").N_h == 8
    s = szlib.MPCSettings(grid=(1, 2, 3))
    assert (s.N, s.N_h, s.step_lengths) == (3, 3, (1, 2, 3))
    assert s.times == pytest.approx((0.0, 0.1, 0.3, 0.6))
    assert szlib.MPCSettings(N=4).step_lengths == (1,) * 4


@pytest.mark.parametrize("dt", [0.05, 0.1, 0.4])
def test_a_gamma_rate_lets_h_fall_equally_fast_whatever_dt_is(dt: float) -> None:
    settings = szlib.MPCSettings(dt=dt).with_gamma_rate(0.8)
    assert (1 - settings.gamma) ** (1 / dt) == pytest.approx(np.exp(-0.8))
    assert settings.gamma_rate == pytest.approx(0.8)
    assert szlib.MPCSettings(gamma=1).gamma_rate == np.inf
    with pytest.raises(szlib.SolverError, match="gamma must be in"):
        settings.with_gamma_rate(-1)


def test_a_number_of_steps_that_the_grid_overrules_is_refused():
    for counts in ({"N": 20}, {"N_h": 3}):
        with pytest.raises(szlib.SolverError, match="because `grid` sets them"):
            szlib.MPCSettings.among_people(**counts)
    assert szlib.MPCSettings.among_people(grid=(), N=20, N_h=3).N == 20
