"""A Makefile for an exported folder that builds it for a bare Cortex-M, and checks it in an
emulator.
"""

from __future__ import annotations

import os
from pathlib import Path

from symheli.errors import UnknownNameError
from symheli.export.c_program import filled
from symheli.values.whole_files import write_own, write_text

HERE = Path(__file__).parent
"""board.mk, the Makefile with marked places, startup.c, measure.h and mps2.ld lie here."""

TARGETS = ("cortex-m4", "cortex-m7")
"""Cores, each with its floating-point unit: single precision on an M4, double on an M7."""

HARNESS = ("startup.c", "measure.h", "mps2.ld")
"""Files that start a check program in the emulator and measure it; nothing of them flies."""


def write_board(folder: str | os.PathLike[str], target: str) -> tuple[Path, ...]:
    """Write a Makefile beside exported C code, for arm-none-eabi-gcc and a bare Cortex-M.

    `make -C FOLDER` compiles every exported file of the folder into one library. `make -C FOLDER
    check` runs each NAME_check.c in qemu-system-arm, and prints the instructions and the stack of a
    step.

    Parameters
    ----------
    folder : path
        Folder of the exported files; made as needed.
    target : {"cortex-m4", "cortex-m7"}
        Default of the Makefile; `make TARGET=...` takes the other.

    Returns
    -------
    tuple of Path
        Makefile, board/startup.c, board/measure.h and board/mps2.ld. A Makefile that this function
        did not write is left alone, and not returned.

    Raises
    ------
    UnknownNameError
        For another target.
    SymheliError
        Where a file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from symheli.export import write_board
    >>> folder = tempfile.TemporaryDirectory()
    >>> [file.name for file in write_board(folder.name, "cortex-m4")]
    ['startup.c', 'measure.h', 'mps2.ld', 'Makefile']
    >>> folder.cleanup()
    """
    if target not in TARGETS:
        raise UnknownNameError("target", target, TARGETS)
    folder = Path(folder)
    harness = tuple(
        write_text(folder / "board" / name, (HERE / name).read_text(encoding="utf-8"))
        for name in HARNESS
    )
    own = write_own(folder / "Makefile", filled(HERE / "board.mk", {"target": target}))
    return harness if own is None else (*harness, own)
