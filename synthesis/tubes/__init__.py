"""Invariant tubes: sets that the nonlinear helicopter does not leave, whatever the gusts."""

from synthesis.tubes.tube import Tube, tube

__all__ = ["Tube", "tube"]
