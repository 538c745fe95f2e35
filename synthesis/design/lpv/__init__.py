"""Scheduled controllers and estimators: existence by LMIs, the search for X and Y, recovery."""
