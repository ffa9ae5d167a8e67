"""Whole numbers on the command line: 1.5 is refused, not rounded."""

from collections.abc import Sequence
from typing import Annotated, Any

from cyclopts import Parameter, Token

from services.runtime.config.errors import LindyError


def whole(_: Any, tokens: Sequence[Token]) -> int:
    """
    Raises:
        LindyError: it is not a whole number.
    """
    token = tokens[0]
    try:
        return int(token.value)
    except ValueError:
        raise LindyError(
            f"{token.keyword} is {token.value!r}, expected a whole number such as 7"
        ) from None


Whole = Annotated[int, Parameter(converter=whole)]
