"""Cone programs, their solvers, and the units in which they are solved."""
