"""Entries of a vehicle file that a component, or a section of every airframe, requires."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Entry:
    """One number of a vehicle file.

    Parameters
    ----------
    unit : str
        In SI; any unit that converts to it is read.
    meaning : str
        What the number is, for whoever fills it in.
    symbol : str
        LaTeX; the entry's name where it is empty.
    kind : str
        The quantity whose plausible range it is held to, a name of
        `symheli.airframe.plausibility.RANGES`; any number passes where it is empty.
    positive : bool
        It must be > 0.
    least : int, optional
        It is a whole number, at least this.
    optional : bool
        A file may leave it out.

    Examples
    --------
    >>> from symheli.components import Entry
    >>> Entry("m^2", "area of the wing", positive=True).unit
    'm^2'
    """

    unit: str
    meaning: str = ""
    symbol: str = ""
    kind: str = ""
    positive: bool = False
    least: int | None = None
    optional: bool = False
