"""`lindy completion`: what a shell needs to complete verbs, options and files."""

from typing import Any, Literal

from cyclopts import App

from services.runtime.config.errors import LindyError
from tools.__main__ import LOG, VERBS, function_of

Shell = Literal["bash", "zsh", "fish"]


def completion(shell: Shell) -> int:
    """Print the completion of verbs and options for a shell.

    In bash, for this terminal: source <(lindy completion bash). For every terminal its output
    belongs into ~/.local/share/bash-completion/completions/lindy; in zsh into a file _lindy in a
    folder of fpath; in fish into ~/.config/fish/completions/lindy.fish.

    Example: lindy completion bash
             lindy completion zsh
    """
    print(_whole().generate_completion(prog_name="lindy", shell=shell))
    return 0


def _whole() -> App:
    """Every verb with its options, which otherwise are loaded for the verb that runs alone."""
    program = App(name="lindy")
    log = App(name="log", help=VERBS["log"].help)
    for app, verbs in ((program, VERBS), (log, LOG)):
        for name, verb in verbs.items():
            if name == "log":
                app.command(log)
            elif (found := _known(name, verb.place)) is not None:
                app.command(found, name=None if isinstance(found, App) else name)
    return program


def _known(name: str, place: str) -> Any:
    try:
        return function_of(name, place)
    except LindyError:  # of the package lindy-research
        return None
