"""The model for other programs: C99 source, MATLAB files; and the controller that flies it."""

from symheli.export.c import write_c
from symheli.export.controller import write_controller
from symheli.export.mat import write_family_mat, write_mat

__all__ = ["write_c", "write_controller", "write_family_mat", "write_mat"]
