"""When the calls of a study were computed, drawn as text."""

from __future__ import annotations

from collections.abc import Sequence

from studies.transition.schedule import Span

WIDTH = 60
"""Columns of a drawn schedule."""


def drawn(spans: Sequence[Span], begin: float, end: float) -> str:
    """A line a title, begun first on top: when its calls were computed (`#` in processes, `=` in
    the one that waits for them), and how long the processor worked on them.
    """
    titles = list(dict.fromkeys(one.title for one in sorted(spans, key=lambda one: one.begin)))
    lines = []
    for title in titles:
        own, bar = [one for one in spans if one.title == title], [" "] * WIDTH
        for one in own:
            first, last = (int((at - begin) / (end - begin) * WIDTH) for at in (one.begin, one.end))
            for column in range(first, min(last, WIDTH - 1) + 1):
                bar[column] = "=" if one.here else "#"
        worked = sum(one.processor for one in own)
        lines.append(f"{title[:44]:44} |{''.join(bar)}| {worked:6.1f} s")
    worked = sum(one.processor for one in spans)
    lines.append(
        f"{end - begin:.1f} s on the wall; {worked:.1f} s of the processor in"
        f" {len(spans)} calls, {worked / (end - begin):.2f} cores on the average"
    )
    return "\n".join(lines)
