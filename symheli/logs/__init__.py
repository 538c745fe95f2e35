"""Readers of flight logs: each returns (time (n,) in s, columns {name: array}, units {name: unit})
for a `FlightRecord`.
"""
