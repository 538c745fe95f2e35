"""Text printed at the end of the study: the answer, and its basis."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from typing import TYPE_CHECKING

from studies.transition.conclusions import answer, conclusions, of_the_vehicle, question
from studies.transition.shortfalls import counted, without_certificate

if TYPE_CHECKING:
    from studies.transition.outcome import Outcome

WIDTH = 98


def summary(study: Outcome) -> str:
    """Question, answer, the vehicle and the conclusions, in lines that a terminal holds."""
    if not study.seconds and study.baseline is None:
        return "nothing was finished"
    return "\n".join(_lines(study))


def _lines(study: Outcome) -> Iterator[str]:
    yield from _wrapped(question(study))
    yield from _wrapped(answer(study) or "Nothing was reached that answers this.", "  ")
    for title, sentences in (
        ("The helicopter", of_the_vehicle(study)),
        ("What was found", conclusions(study)),
        ("Negative results", [*without_certificate(study), *counted(study)]),
    ):
        own = [sentence for sentence in sentences if sentence not in answer(study)]
        if own:
            yield ""
            yield title
        for sentence in own:
            yield from _wrapped(sentence, "  - ")


def _wrapped(sentence: str, mark: str = "") -> list[str]:
    return textwrap.wrap(sentence, WIDTH, initial_indent=mark, subsequent_indent=" " * len(mark))
