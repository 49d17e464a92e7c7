"""The errors of szlib. ``except SzlibError`` catches them all."""

import warnings


class SzlibError(Exception):
    """Base class of every error that szlib raises on purpose.

    Examples
    --------
    >>> try:
    ...     szlib.Ellipse(center=(0.0, 0.0), semi_axes=(1.0, -1.0))
    ... except szlib.SzlibError as error:
    ...     print(type(error).__name__)
    ZoneError
    """


class DataError(SzlibError, ValueError):
    """Input data cannot be used: a file, a table, a row, or a value in it.

    Examples
    --------
    >>> try:
    ...     szlib.read_tracks("missing.csv")
    ... except szlib.DataError as error:
    ...     print(error)
    missing.csv...
    """


class StorageError(DataError):
    """A file or a folder cannot be written: no space, no permission, or it holds files of other programs.

    Examples
    --------
    >>> from pathlib import Path
    >>> from szlib.core.files import claim_folder
    >>> Path("thesis").mkdir()
    >>> _ = Path("thesis/chapter.txt").write_text("...")
    >>> try:
    ...     claim_folder("thesis", "days")
    ... except szlib.StorageError as error:
    ...     print(error)
    thesis: holds files that szlib did not write, such as 'chapter.txt'; choose ...
    """


class MemoryLimitError(DataError):
    """Data needs more memory than is available or allowed.

    Examples
    --------
    >>> from szlib.core.input_files import environment, require_memory
    >>> try:
    ...     with environment(SZLIB_MEMORY="1GB"):
    ...         require_memory(5e9, "the table")
    ... except szlib.MemoryLimitError as error:
    ...     print(error)
    the table takes about 5 GB of memory, and the limit is 1 GB; ...
    """


class ZoneError(SzlibError, ValueError):
    """A social zone or an ellipse is undefined for the given data or parameters.

    Examples
    --------
    >>> try:
    ...     szlib.minimum_enclosing_ellipse([(0.0, 0.0), (1.0, 1.0)])
    ... except szlib.ZoneError as error:
    ...     print("no ellipse")
    no ellipse
    """


class SolverError(SzlibError, RuntimeError):
    """The controller was set up or called with invalid arguments.

    Examples
    --------
    >>> try:
    ...     szlib.MPCSettings(gamma=2.0)
    ... except szlib.SolverError as error:
    ...     print("gamma" in str(error))
    True
    """


class DataWarning(UserWarning):
    """Rows were rejected, or a zone is unreliable; the message counts the rows by reason.

    Examples
    --------
    >>> import warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore", szlib.DataWarning)  # in a loop over many files
    """


def warn(message: str, stacklevel: int = 2) -> None:
    """Give a DataWarning with a `message`; `stacklevel` as in `warnings.warn`, counted from the caller."""
    warnings.warn(message, DataWarning, stacklevel=stacklevel + 1)
