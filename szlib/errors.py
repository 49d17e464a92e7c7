"""The errors of szlib. ``except SzlibError`` catches them all."""


class SzlibError(Exception):
    """Root of every error that szlib raises on purpose."""


class DataError(SzlibError, ValueError):
    """Input data cannot be used: a file, a table, a row, or a value in it."""


class StorageError(DataError):
    """A file or a folder cannot be written: no room, no permission, or it holds files of others."""


class MemoryLimitError(DataError):
    """Data needs more memory than is available or allowed."""


class ZoneError(SzlibError, ValueError):
    """A social zone or an ellipse is undefined for the given data or parameters."""


class SolverError(SzlibError, RuntimeError):
    """The controller was set up or called with invalid arguments."""


class DataWarning(UserWarning):
    """Rows were rejected, or a zone is unreliable; the message counts the rows by reason."""
