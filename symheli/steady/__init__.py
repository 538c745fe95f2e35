"""Steady flight: trims, exact linear models about them, sweeps and maps of both."""
