"""The exceptions of the package."""


class NubisError(Exception):
    """Base class of all errors that nubis raises."""


class ParameterError(NubisError, ValueError):
    """A value that is not allowed. The message names the field, the value and the allowed range.

    Raised before any GPU work.
    """


class AdapterError(NubisError, RuntimeError):
    """No usable or no matching adapter. The message lists those found and a package that helps."""


class DeviceError(NubisError, RuntimeError):
    """The device is lost or out of memory. A new `Renderer` recovers."""


class ForkError(NubisError, RuntimeError):
    """Use in a forked child, which lacks the threads of the driver. Start workers by spawn."""


class FileError(NubisError, OSError):
    """A file cannot be written or read."""
