"""Exceptions: each carries the one line that the command would print."""


class FlexsplineError(Exception):
    """Something that Flexspline refuses or denies."""

    def __str__(self) -> str:
        # names that the caller gave may have line breaks in them
        return " ".join(super().__str__().splitlines())


class InputError(FlexsplineError, ValueError):
    """Bad input: what is wrong, where, and what to change. Nothing was done."""


class NegativeError(FlexsplineError, RuntimeError):
    """It was done, and the answer is no."""


class FormatWarning(UserWarning):
    """What a simulator's format cannot say of a robot."""
