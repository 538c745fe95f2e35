"""A process of `studies.processes`: calls come pickled on standard input, results go to standard
output.
"""

from __future__ import annotations

from studies.threads import one_thread

one_thread()  # before NumPy is imported

import os  # noqa: E402
import pickle  # noqa: E402
import sys  # noqa: E402


def main() -> None:
    """Compute until there is nothing more to read."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what a call prints is no answer
    while True:
        try:
            call = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        try:
            answer = pickle.dumps((True, call()))
        except Exception as error:
            answer = _failed(error)
        answers.write(answer)
        answers.flush()


def _failed(error: Exception) -> bytes:
    try:
        return pickle.dumps((False, error))
    except Exception:
        return pickle.dumps((False, RuntimeError(f"{type(error).__name__}: {error}")))


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:  # whoever started it says so
        sys.exit(130)
