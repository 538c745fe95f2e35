"""Loops of an autopilot: their responses before and after a change of gains."""
