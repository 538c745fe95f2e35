"""Cone programs, the solvers that take them, and the units in which they are solved."""
