"""The command line: `symheli VERB ...`."""

from __future__ import annotations

import argparse
import importlib
import os
import sys
import warnings
from collections.abc import Sequence
from typing import Any

from studies.output import Output, as_json
from studies.threads import one_thread
from symheli.errors import SymheliError

VERBS = (
    "study",
    "vehicles",
    "trim",
    "linearize",
    "derivatives",
    "envelope",
    "identify",
    "margins",
    "certify",
    "verify",
    "export",
    "campaign",
    "pays",
    "design",
    "doctor",
    "completion",
)
"""Each is the module of that name in `studies.commands`."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb; the exit status: 0 done, 1 failed with one sentence on stderr, 2 wrong usage,
    130 interrupted.
    """
    one_thread()
    try:
        arguments = parser().parse_args(argv)
    except SystemExit as stop:  # argparse has said what is wrong
        return int(stop.code or 0)
    with warnings.catch_warnings():
        warnings.showwarning = _note
        try:
            output: Output = arguments.run(arguments)
            print(as_json(output.data) if arguments.json else output.text, flush=True)
            return output.status
        except SymheliError as error:
            return _fail("\n  ".join(" ".join(s.split()) for s in str(error).splitlines()))
        except KeyboardInterrupt:
            print(f"\nsymheli: interrupted; {arguments.kept(arguments)}", file=sys.stderr)
            return 130
        except BrokenPipeError:  # the reader, such as head, has seen enough
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 0
        except OSError as error:
            return _fail(f"{error.filename or 'a file'}: {error.strerror or error}")


def parser() -> argparse.ArgumentParser:
    """The parser with every verb."""
    from symheli import __version__

    whole = argparse.ArgumentParser(
        prog="symheli", description="Helicopter models, LPV identification, certified gains."
    )
    whole.add_argument("--version", action="version", version=f"symheli {__version__}")
    verbs = whole.add_subparsers(dest="verb", required=True, metavar="VERB")
    for verb in VERBS:
        module = importlib.import_module(f"studies.commands.{verb}")
        sub = verbs.add_parser(verb, help=module.HELP, description=module.HELP)
        sub.set_defaults(
            run=module.run,
            kept=lambda _: "nothing was written, files that were there are unchanged",
        )
        module.configure(sub)
        sub.add_argument("--json", action="store_true", help="print what a program would read")
    return whole


def _fail(sentence: str) -> int:
    print(f"symheli: {sentence}", file=sys.stderr)
    return 1


def _note(message: Any, *_: Any, **__: Any) -> None:
    print(f"symheli: note: {message}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
