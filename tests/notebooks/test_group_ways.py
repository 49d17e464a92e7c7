"""Ways between two people of a group: crossed, passed by, too wide, and too late."""

import numpy as np
import pytest
from studies.group_ways import walks_between
from studies.replay import RecordedPerson

TIMES = np.arange(0, 4, 0.1)


def walk_along(y, *, first=0):
    """Somebody who walks along x at 0.5 m/s, from tick `first` on, for 4 s."""
    x = 0.05 * np.arange(40)
    return RecordedPerson(
        1, first, np.column_stack([x, 0 * x + y, 0 * x + 0.5, 0 * x, 0 * x])
    )


@pytest.mark.parametrize(
    ("speed", "gap", "first", "expected"),
    [
        pytest.param(1.5, 1.0, 0, True, id="overtakes between them"),
        pytest.param(0.3, 1.0, 0, False, id="stays behind them"),
        pytest.param(1.5, 4.0, 0, False, id="they are far apart"),
        pytest.param(1.5, 1.0, 30, False, id="one of them comes later"),
    ],
)
def test_between_two_people(speed, gap, first, expected):
    path = np.column_stack([speed * TIMES - 1, 0.1 + 0 * TIMES])
    one, other = walk_along(gap / 2), walk_along(-gap / 2, first=first)
    assert walks_between(TIMES, path, one, other) is expected
    assert walks_between(TIMES, path[:, ::-1] + [0, 9], one, other) is False
