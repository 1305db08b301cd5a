"""Errors a user can meet. Each is one line and carries the exit code of the command that raised it."""


class KoopError(Exception):
    """Base of every error that ends a command with one clear line instead of a traceback."""

    exit_code = 1


class UsageError(KoopError):
    """An option, setting or enumerated value that does not exist."""

    exit_code = 2


class MisplacedError(UsageError):
    """A ``setting`` that exists, of another kind than the one that was chosen."""

    def __init__(self, text: str, setting: str) -> None:
        super().__init__(text)
        self.setting = setting


class InvalidValueError(KoopError):
    """A value out of range, not a number, or a user's file that cannot be used."""

    exit_code = 3


class UnknownNameError(KoopError):
    """A vehicle, figure, experiment or artefact that is unknown or ambiguous."""

    exit_code = 4


class DamagedArtefactError(KoopError):
    """Stored bytes that do not match their digest and cannot be made again."""

    exit_code = 5


class StorageError(KoopError):
    """The disk is full, read-only, forbidden or failing."""

    exit_code = 6


class LockTimeoutError(KoopError):
    """Another process held the lock of an artefact for too long."""

    exit_code = 7


class NewerFormatError(KoopError):
    """A record written by a version of the program with another format."""

    exit_code = 8


class OlderFormatError(NewerFormatError):
    """A record of a format that this version no longer reads."""
