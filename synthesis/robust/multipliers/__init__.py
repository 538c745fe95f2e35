"""Gains of loops with several uncertain blocks, by dynamic multipliers."""
