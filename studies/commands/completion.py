"""symheli completion: what a shell needs to complete the command line."""

from __future__ import annotations

import argparse

from studies.commands.arguments import positional
from studies.output import Output
from symheli.extras import extra

HELP = "print the completion of this command line for bash, zsh or tcsh"

SHELLS = ("bash", "zsh", "tcsh")

ARGUMENTS = (positional("shell", "shell for which to print the completion", choices=SHELLS),)


def run(arguments: argparse.Namespace) -> Output:
    """The script; a shell evaluates it, or reads it from a file of its completions."""
    with extra("shell", "completion of the command line"):
        import shtab

    script = shtab.complete(arguments.every_verb, shell=arguments.shell)
    return Output(script, {"shell": arguments.shell, "script": script})
