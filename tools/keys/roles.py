"""Who a certificate says somebody is: a role and a name. Pure."""

from typing import Literal, NamedTuple, get_args

from services.runtime.bus.spaces import LONGEST, MAY_HAVE, NAME

Role = Literal["drone", "pilot", "observer", "router"]
ROLES: tuple[Role, ...] = get_args(Role)
LETS_IN: dict[Role, tuple[Role, ...]] = {  # whom each role has a use for
    "drone": ("pilot", "observer", "router"),
    "pilot": ("drone", "router"),
    "observer": ("drone", "router"),
    "router": ("drone", "pilot", "observer", "router"),
}


class Identity(NamedTuple):
    """Written `pilot:ann`, which is also the common name in the certificate."""

    role: Role
    name: str

    def __str__(self) -> str:
        return f"{self.role}:{self.name}"

    @property
    def folder(self) -> str:
        """Name of the folder with the keys."""
        return f"{self.role}-{self.name}"


def parse(text: str) -> Identity:
    """
    Raises:
        ValueError: not `role:name`, no such role, or not a name.
    """
    role, colon, name = text.partition(":")
    if not colon:
        raise ValueError(f"{text!r} is not ROLE:NAME, such as pilot:ann")
    if role not in ROLES:
        raise ValueError(f"unknown role {role!r}, expected {', '.join(ROLES)}")
    if NAME.fullmatch(name) is None:
        raise ValueError(f"{name[: 2 * LONGEST]!r} is no name: it may have {MAY_HAVE}")
    return Identity(role, name)


def parse_list(text: str) -> tuple[Identity, ...]:
    """The lines of a list of names; what follows a # is a remark.

    Raises:
        ValueError: a line that is not `role:name`, with its number.
    """
    found: list[Identity] = []
    for number, line in enumerate(text.splitlines(), start=1):
        if word := line.partition("#")[0].strip():
            try:
                found.append(parse(word))
            except ValueError as error:
                raise ValueError(f"line {number}: {error}") from None
    return tuple(found)


def with_one(text: str, who: Identity) -> str:
    """The list with one name more, at its end; nothing else in it changes."""
    if who in parse_list(text):
        return text
    return f"{text}{'' if text.endswith(chr(10)) or not text else chr(10)}{who}\n"


def without(text: str, who: Identity) -> str:
    """The list without a name; nothing else in it changes."""
    parse_list(text)  # an error names the line of the whole list
    lines = text.splitlines(keepends=True)
    return "".join(line for line in lines if parse_list(line) != (who,))
