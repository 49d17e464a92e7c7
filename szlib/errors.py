"""The errors of szlib: one root, so that ``except SzlibError`` catches them all."""


class SzlibError(Exception):
    """Root of every error that szlib raises on purpose."""


class DataError(SzlibError, ValueError):
    """Input data cannot be used: a file, a table, a row, or a value in it."""


class StorageError(DataError):
    """A file or a folder cannot be written: no room, no permission, or it is not szlib's to replace."""


class MemoryLimitError(DataError):
    """Data needs more memory than there is, or than was granted."""


class ZoneError(SzlibError, ValueError):
    """A social zone or an ellipse is undefined for what was given."""


class SolverError(SzlibError, RuntimeError):
    """The controller was set up or asked in a way that has no meaning."""


class DataWarning(UserWarning):
    """Rows or speeds were set aside; the message counts them by reason."""
