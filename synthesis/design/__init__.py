"""Controllers: the plant they are designed for."""
