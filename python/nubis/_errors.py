"""The exceptions of the package."""


class NubisError(Exception):
    """Base of all errors that nubis raises."""


class ParameterError(NubisError, ValueError):
    """An argument is not allowed: names the field, the value and what is allowed.

    Raised before any GPU work.
    """


class AdapterError(NubisError, RuntimeError):
    """No usable adapter, or not the one asked for: lists those found and what would help."""


class DeviceError(NubisError, RuntimeError):
    """The device was lost or is out of memory; a new `Renderer` works."""


class ForkError(NubisError, RuntimeError):
    """Used in a forked child, where the driver's threads do not exist: start workers by spawn."""


class FileError(NubisError, OSError):
    """A file could not be written or read."""
