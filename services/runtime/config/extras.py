"""Optional dependencies (extras of the package)."""

from messages.version import VERSION
from services.runtime.config.settings import DEPLOY


def how_to_install(extra: str) -> str:
    """The end of an error sentence about an extra that is not installed."""
    if (DEPLOY.parent / "pyproject.toml").exists():
        return f"in the folder of Lindy's source, `uv sync --extra {extra}` installs it"
    wheel = f"lindy-{VERSION}-py3-none-any.whl"
    return f"`pip install '{wheel}[{extra}]'` installs it, Lindy's wheel with this extra"
