"""Optional dependencies (extras of the package)."""


def how_to_install(extra: str) -> str:
    """The end of an error sentence about an extra that is not installed."""
    ways = f"`uv sync --extra {extra}` or `pip install '.[{extra}]'`"
    return f"in the folder of Lindy's source, {ways} installs it"
