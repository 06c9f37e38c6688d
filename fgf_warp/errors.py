"""The errors that a user can meet, each with one or two lines that say what, where, and what is accepted."""


class FgfError(Exception):
    """Base of every error that FGF-Warp raises on purpose."""


class SceneError(FgfError):
    """A scene that cannot be rendered as written: a parameter out of its domain, a broken stage."""


class MediumError(SceneError):
    """A medium that cannot be: a parameter out of the domain of its law, or a shape that cannot hold it."""


class OpenMeshError(MediumError):
    """A mesh that a medium is to fill, and that is not closed."""


class ConfigError(FgfError):
    """A setting, command-line value or sweep config that is not accepted."""


class UnsupportedFeatureError(FgfError):
    """A scene asks for something that this version does not do and that cannot be left out with a warning."""


class NumericalError(FgfError):
    """A render produced samples that are not finite."""


class OutputError(FgfError):
    """A file or folder cannot be written, or was written incompletely."""


class CorruptFileError(FgfError):
    """A file that FGF-Warp wrote is missing, incomplete, or not what was written."""
