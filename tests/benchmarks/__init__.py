"""A package of its own: pyarrow 17 installs another one of this name."""
