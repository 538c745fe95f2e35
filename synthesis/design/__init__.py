"""Controllers: the plants they are designed for, and the designs."""
