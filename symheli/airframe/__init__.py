"""Airframes as data: vehicle files, their parts, and linear models others identified."""
