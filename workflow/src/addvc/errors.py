"""The one family of errors a user can mend: the message gives the value, the limit, the remedy."""


class AddvcError(ValueError):
    """Something in the input or the configuration that the user can change."""


class ScanError(AddvcError):
    """A scan that cannot be read, or is not what the configuration says it is."""


class ConfigError(AddvcError):
    """A configuration that cannot be run."""


class GeometryError(AddvcError):
    """A specimen, threshold or surface that cannot be made from the image."""


class MeshError(AddvcError):
    """A mesh on which no displacement could be trusted."""


class CorrelationError(AddvcError):
    """A linear system or a registration that cannot be solved."""
