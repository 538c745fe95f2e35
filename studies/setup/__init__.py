"""Choices that the studies share: flights, axes, sizes of signals, bounds and stored stages."""
