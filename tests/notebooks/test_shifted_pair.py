"""The first figure of chapter 06: a pair, the pair with a delay, and how near all pairs come."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from studies import shifted_pair


def test_the_nearest_approach_of_each_encounter_counts_if_it_is_within_r_max():
    samples = pd.DataFrame(
        {
            "encounter": [1, 1, 2, 2],
            "kind": ["crossing"] * 2 + ["opposite"] * 2,
            "distance": [1.5, 0.8, 2.5, 2.1],
        }
    )
    null = SimpleNamespace(encounters=pd.DataFrame({"nearest": [0.3, 2.0, 1.9]}))
    seen, chance = shifted_pair.list_approaches(samples, null, 2.0)
    assert seen.to_dict("index") == {1: {"kind": "crossing", "nearest": 0.8}}
    assert chance["nearest"].tolist() == [0.3, 1.9]


@pytest.mark.parametrize(("delay", "when"), [(2.0, "later"), (-0.5, "earlier")])
def test_the_figure_says_how_many_pairs_come_near(delay, when):
    path = np.column_stack([np.arange(12.0), np.zeros(12)])
    pair = (path, np.add(path, (0, 1.2)), np.add(path, (0, 0.4)), delay)
    seen = pd.Series([0.5, 1.0, 1.5, 1.9])
    chance = pd.Series([0.1, 0.6, 1.0])
    figure = shifted_pair.draw_shifted_pair(pair, seen, chance, 2.0)
    walked, delayed, counts = figure.axes
    assert walked.get_title() == "As they walked: 1.20 m apart"
    assert delayed.get_title() == f"One {abs(delay):.1f} s {when}: 0.40 m apart"
    assert walked.get_xlim() == delayed.get_xlim() == (-0.3, 11.3)
    assert counts.get_title() == "Within 0.7 m: 25 % of the pairs, shifted 67 %"
    assert "[m]" in counts.get_xlabel()
