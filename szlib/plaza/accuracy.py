"""The precision and recall of a rule for outliers."""

import numpy as np
from numpy.typing import NDArray

from ..core.errors import DataError


def precision_and_recall(
    removed: NDArray[np.bool_], intruders: NDArray[np.bool_]
) -> tuple[float, float]:
    """Compute the precision and recall of a rule that removes intruders.

    Parameters
    ----------
    removed : whether the rule removed each sample (or encounter), shape (n,).
    intruders : whether each is an intruder's, shape (n,).

    Returns
    -------
    The share of intruders among the removed, and the share of the intruders that is removed; nan for a share
    of nothing.

    Raises
    ------
    DataError : the shapes differ.

    Examples
    --------
    >>> import numpy as np
    >>> from szlib.plaza import precision_and_recall
    >>> precision_and_recall(np.array([True, True, False]), np.array([True, False, False]))
    (0.5, 1.0)
    """
    removed = np.asarray(removed, bool)
    intruders = np.asarray(intruders, bool)
    if removed.shape != intruders.shape:
        raise DataError(
            f"expected two arrays of one shape; got {removed.shape} and {intruders.shape}"
        )
    found = removed & intruders
    precision, recall = (
        float(found[each].mean()) if each.any() else np.nan
        for each in (removed, intruders)
    )
    return precision, recall
