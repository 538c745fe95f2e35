"""The command line: `symheli VERB ...`."""

from __future__ import annotations

import argparse
import contextlib
import importlib
import os
import re
import sys
import warnings
from collections.abc import Iterator, Sequence
from typing import Any, NoReturn

from studies.commands.arguments import add, renamed
from studies.output import Output, as_json
from studies.progress import displayed
from studies.threads import one_thread
from symheli.errors import InputError, SymheliError, TrimError, UnknownNameError

VERBS = (
    "study",
    "vehicles",
    "trim",
    "linearize",
    "derivatives",
    "envelope",
    "identify",
    "calibrate",
    "tune",
    "margins",
    "specs",
    "synthesize",
    "certify",
    "verify",
    "export",
    "campaign",
    "compare",
    "experiment",
    "live",
    "circle",
    "serve",
    "doctor",
    "completion",
)
"""Each is the module of that name in `studies.commands`."""

FORMER = {"design": "experiment", "pays": "compare"}
"""Verbs of the last release, and what they are now."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return the exit status: 0 done, 1 failed with one sentence on stderr, 2
    wrong usage, 130 interrupted. With --json a failure is on stdout too, as {"error": {"type",
    "message"}}.
    """
    one_thread()
    arguments = None
    words = list(sys.argv[1:] if argv is None else argv)
    asks_json = "--json" in words
    try:
        arguments = parsed(words)
        return _run(arguments)
    except UsageError as error:
        return _fail(error, asks_json, status=2)
    except SystemExit as stop:  # --help, --version
        return int(stop.code or 0)
    except (KeyboardInterrupt, SystemError) as error:
        if isinstance(error, SystemError) and not isinstance(error.__cause__, KeyboardInterrupt):
            raise
        kept = arguments.kept(arguments) if arguments else "nothing was begun"
        print(f"\nsymheli: interrupted; {kept}", file=sys.stderr)
        return 130


def _run(arguments: argparse.Namespace) -> int:
    with warnings.catch_warnings():
        warnings.showwarning = _PrintedOnce()
        try:
            with displayed(), _allowed(arguments):
                output: Output = arguments.run(arguments)
            print(as_json(output.data) if arguments.json else output.text, flush=True)
            return output.status
        except TrimError as error:
            return _fail(error, arguments.json, f"{error.reason}; try a lower airspeed")
        except SymheliError as error:
            return _fail(error, arguments.json)
        except BrokenPipeError:  # the reader, such as head, has closed the pipe
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 0
        except OSError as error:
            sentence = f"{error.filename or 'a file'}: {error.strerror or error}"
            return _fail(error, arguments.json, sentence)


@contextlib.contextmanager
def _allowed(arguments: argparse.Namespace) -> Iterator[None]:
    """Let this command and the processes that it starts run Python files, where --allow-code is
    given. Raises `InputError` where nothing that is read could name one.
    """
    if not getattr(arguments, "allow_code", False):
        yield
        return
    files = [*map(str, getattr(arguments, "logs", ())), str(getattr(arguments, "file", ""))]
    if not any(name.endswith(".toml") for name in (str(arguments.vehicle), *files)):
        raise InputError(
            "--allow-code runs the Python files that a vehicle file or a campaign names, and no"
            " such file is given: leave it out"
        )
    from symheli.components import ALLOW_CODE

    before = os.environ.get(ALLOW_CODE)
    os.environ[ALLOW_CODE] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[ALLOW_CODE]
        else:
            os.environ[ALLOW_CODE] = before


def parsed(words: Sequence[str]) -> argparse.Namespace:
    """The arguments of a verb; raises `UsageError`, with the nearest names for one that is unknown.

    Without a verb the verbs are shown.
    """
    whole = parser()
    words, verb = list(words), None
    place = next((k for k, word in enumerate(words) if not word.startswith("-")), None)
    if place is not None:
        verb = words[place] = renamed(FORMER, "symheli")(words[place])
    if verb is None and not {"-h", "--help", "--version"} & set(words):
        whole.print_help(sys.stderr)
        raise UsageError("give a command; `symheli COMMAND --help` lists its options")
    if verb is not None and verb not in VERBS:
        raise UsageError(str(UnknownNameError("verb", verb, VERBS)))
    arguments, left = whole.parse_known_args(words)
    if not left:
        return arguments
    option = next((word.partition("=")[0] for word in left if word.startswith("-")), None)
    if option is None:
        raise UsageError(f"symheli {verb} does not take {left[0]!r}; see symheli {verb} --help")
    known = dict.fromkeys(re.findall(r"--[a-z][a-z-]*", arguments.usage()))
    raise UsageError(str(UnknownNameError("option", option, known)))


class UsageError(SymheliError):
    """The command line cannot be understood."""


class Parser(argparse.ArgumentParser):
    """Parser that raises an exception for wrong usage, so that it is reported like every
    failure.
    """

    def error(self, message: str) -> NoReturn:
        """Print the usage and raise `UsageError`."""
        self.print_usage(sys.stderr)
        raise UsageError(message)


def parser() -> Parser:
    """The parser with every verb."""
    from symheli import __version__

    whole = Parser(
        prog="symheli", description="Helicopter models, LPV identification, certified gains."
    )
    whole.add_argument("--version", action="version", version=f"symheli {__version__}")
    verbs = whole.add_subparsers(dest="verb", required=True, metavar="VERB")
    for verb in VERBS:
        module = importlib.import_module(f"studies.commands.{verb}")
        sub = verbs.add_parser(verb, help=module.HELP, description=module.HELP)
        kept = getattr(module, "kept", _nothing_written)
        sub.set_defaults(run=module.run, usage=sub.format_usage, kept=kept, every_verb=whole)
        sub.set_defaults(default_of=sub.get_default)
        add(sub, module.ARGUMENTS)
        sub.add_argument("--json", action="store_true", help="print what a program would read")
    return whole


def _nothing_written(_: argparse.Namespace) -> str:
    return "nothing was written, files that were there are unchanged"


def _fail(error: Exception, asks_json: bool, sentence: str = "", status: int = 1) -> int:
    """Print the failure, as `sentence` or as the text of the error, and return the exit status."""
    sentence = sentence or "\n  ".join(" ".join(s.split()) for s in str(error).splitlines())
    print(f"symheli: {sentence}", file=sys.stderr)
    if asks_json:
        report = {"error": {"type": type(error).__name__, "message": sentence}}
        with contextlib.suppress(OSError):  # it may be stdout that failed
            print(as_json(report), flush=True)
    return status


class _PrintedOnce:
    """Warnings, each printed once, however many steps of the work repeat it."""

    def __init__(self) -> None:
        self._said: set[str] = set()

    def __call__(self, message: Any, *_: Any, **__: Any) -> None:
        if (note := str(message)) not in self._said:
            self._said.add(note)
            print(f"symheli: note: {note}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
