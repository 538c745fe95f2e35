"""Numbers of sections, figures, tables, equations and references, in the order of the page.

A page is rendered twice, as LaTeX does it: the first time the numbers are given, the second time
those that are mentioned before they are given are known.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from html import escape

from markupsafe import Markup


class Labels:
    """The numbers of one rendering; `known` are those of the one before, `missing` the words where
    there is none.
    """

    def __init__(
        self, known: Mapping[str, str] | None = None, missing: str = "not reached"
    ) -> None:
        self.known = known or {}
        self.missing = missing
        self.given: dict[str, str] = {}
        self.contents: list[tuple[str, str, str]] = []
        self._counts: Counter[str] = Counter()

    def number(self, kind: str, key: str) -> str:
        """The next of its kind, "Figure 3"; an element with this identifier carries it."""
        self._counts[kind] += 1
        self.given[f"{kind}-{key}"] = str(self._counts[kind])
        return str(self._counts[kind])

    def section(self, key: str, title: str) -> str:
        """The number of a section, which is listed in the contents."""
        number = self.number("section", key)
        self.contents.append((f"section-{key}", number, title))
        return number

    def to(self, kind: str, key: str, first: bool = False) -> Markup:
        """A link, "figure 3", or where it is the `first` word "Figure 3"; of what the study has not
        reached words.
        """
        word, number = kind.capitalize() if first else kind, self.known.get(f"{kind}-{key}")
        if number is None:
            return Markup(f"{escape(word)} {self.missing}")
        return Markup(f'<a href="#{kind}-{escape(key)}">{escape(word)} {number}</a>')
