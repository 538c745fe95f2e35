"""Identification from a user's log: a fitted model and a validation table."""
