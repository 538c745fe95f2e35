"""The verbs of the command line, one module a verb.

Each has `HELP` (one line), `ARGUMENTS` (see `arguments`) and `run(arguments) -> Output`; heavy
imports happen in `run`.
"""
