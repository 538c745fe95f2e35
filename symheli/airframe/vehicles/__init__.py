"""Airframes, one TOML file each."""
