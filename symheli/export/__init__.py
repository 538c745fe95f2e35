"""The model for other programs: C99 source, MATLAB files."""

from symheli.export.c import write_c
from symheli.export.mat import write_mat

__all__ = ["write_c", "write_mat"]
