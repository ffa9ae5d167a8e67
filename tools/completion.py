"""`lindy completion`: what a shell needs to complete verbs, options and files."""

from importlib.util import find_spec
from typing import Literal

from tools.__main__ import RESEARCH, VERBS, command_line

Shell = Literal["bash", "zsh", "fish"]


def completion(shell: Shell, /) -> int:
    """Print the completion of verbs and options for a shell.

    In bash, for this terminal: source <(lindy completion bash). For every terminal its output
    belongs into ~/.local/share/bash-completion/completions/lindy; in zsh into a file _lindy in a
    folder of fpath; in fish into ~/.config/fish/completions/lindy.fish.

    Example: lindy completion bash
             lindy completion zsh
    """
    print(script(shell))
    return 0


def script(shell: Shell) -> str:
    program = command_line()
    if find_spec(RESEARCH) is None:
        for name in (name for name, verb in VERBS.items() if verb.place.startswith(RESEARCH)):
            del program[name]
    return program.generate_completion(prog_name="lindy", shell=shell)
