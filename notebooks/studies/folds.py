"""Long tables of a notebook, closed until the reader opens them."""

from __future__ import annotations

from html import escape

import pandas as pd
from IPython.display import HTML


def fold_table(summary: str, table: pd.DataFrame, decimals: int = 2) -> HTML:
    """A `table` behind one line, the `summary`, that opens it; numbers have so many `decimals`.

    Examples
    --------
    >>> import pandas as pd
    >>> from studies.folds import fold_table
    >>> fold_table("Two sites", pd.DataFrame({"a [m]": [0.97, 0.71]})).data.startswith("<details>")
    True
    """
    content = table.to_html(float_format=f"{{:.{decimals}f}}".format, na_rep="", border=0)
    return HTML(f"<details><summary>{escape(summary)}</summary>\n{content}\n</details>")
