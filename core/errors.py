"""Errors that a user can cause, each worth one clear line."""

from pathlib import Path


class ClosedroomsError(Exception):
    """Base of every error that the command line shows as one line with exit status 1."""


class InvalidInputError(ClosedroomsError):
    """Something that came in is not what was expected.

    The message reads ``what; expected ...: where``, the path last, on one line.
    """

    def __init__(self, what: str, *, expected: str = "", where: str | Path = "") -> None:
        message = " ".join(what.split())
        if expected:
            message += f"; expected {' '.join(expected.split())}"
        if where:
            message += f": {where}"
        super().__init__(message)


class OutputError(ClosedroomsError):
    """The output folder cannot be written, or holds something that is not ours."""
