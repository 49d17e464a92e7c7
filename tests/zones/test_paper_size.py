"""Zones from many samples: shares are exact, copies do no harm, the order of days does not matter.

The paper's full size (half a million samples) runs in `make bench`.
"""

from contextlib import nullcontext

import numpy as np
import pandas as pd
import pytest
from helpers.paper_samples import paper_samples
from sklearn.neighbors import LocalOutlierFactor

import szlib
from szlib.zones import outliers

MANY = 20_000


def test_outliers_are_those_of_scikit_learn():
    samples = paper_samples(MANY)
    points = outliers.complementary_points(samples)
    expected = (
        LocalOutlierFactor(n_neighbors=20, contamination=0.002).fit_predict(points)
        == -1
    )
    assert (outliers.is_outlier(samples, fraction=outliers.FRACTION) == expected).all()
    assert expected.sum() == 0.002 * MANY


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
@pytest.mark.parametrize("fraction", [None, 0.002])
def test_many_copies_do_not_make_lof_explode(share, fraction):
    """As a person who stands still for hours would give; their copies are no outliers, nor make others so."""
    samples = paper_samples(MANY)
    copies = np.arange(MANY) < share * MANY
    samples.loc[copies, ["los_angle", "distance", "speed"]] = [0.3, 1.2, 1.0]
    message = (
        pytest.warns(szlib.DataWarning, match="samples coincide")
        if fraction
        else nullcontext()
    )
    with message:
        outlier = outliers.is_outlier(samples, fraction=fraction)
    with message:
        zone = szlib.SocialZone.fit(
            samples, method="hull", n_resamples=0, speeds=(1.1,), fraction=fraction
        )
    assert outlier.sum() == (pytest.approx(fraction * MANY, abs=1) if fraction else 0)
    plain = szlib.SocialZone.fit(
        samples[~copies], method="hull", n_resamples=0, speeds=(1.1,), fraction=fraction
    )
    assert zone.ellipse(1.1).area == pytest.approx(plain.ellipse(1.1).area, rel=0.15)


@pytest.mark.parametrize("fraction", [None, 0.002])
def test_the_zone_does_not_depend_on_the_order_of_samples(
    fraction,
):
    samples = paper_samples(MANY)
    shuffled = samples.sample(frac=1, random_state=1)
    options = {"speeds": (0.9, 1.1), "fraction": fraction}
    zones = [
        szlib.SocialZone.fit(table, method="hull", n_resamples=0, **options)
        for table in (samples, shuffled)
    ]
    for speed in (0.9, 1.1):
        one, other = (zone.ellipse(speed) for zone in zones)
        np.testing.assert_allclose(
            [*one.center, *one.semi_axes], [*other.center, *other.semi_axes], rtol=1e-9
        )
    kept = [
        outliers.remove_outliers(table, fraction=fraction).sort_index()
        for table in (samples, shuffled)
    ]
    pd.testing.assert_frame_equal(kept[0], kept[1])
