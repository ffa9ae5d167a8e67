"""Parts that are installed only where they are wanted."""


def how_to_install(extra: str) -> str:
    """The end of a sentence about something that is missing."""
    ways = f"`uv sync --extra {extra}` or `pip install '.[{extra}]'`"
    return f"in the folder of Lindy's source, {ways} installs it"
