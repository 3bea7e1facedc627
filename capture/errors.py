"""What a user can put right, told in one line.

Every stage raises these at its door; the command line prints them and exits with code 2.
Anything else is a defect of fishlight and keeps its traceback.
"""


class FishlightError(Exception):
    """A condition that the user, not the programmer, can put right.

    The message names what was wanted, what came and where, and what to do if that is not obvious.
    """


class InputError(FishlightError, ValueError):
    """A file, argument or recording that cannot be used as it is."""


class UnreadableFrame(InputError):
    """One frame that cannot be decoded in full; a stream may go on without it."""


class CameraLost(FishlightError):
    """The camera was unplugged, or its driver gave it up; once back it may be opened again."""


class CameraStalled(FishlightError):
    """The camera is there but sends no frame that can be used; opening it again often helps."""
