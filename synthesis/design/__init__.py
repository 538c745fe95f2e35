"""Controllers: plants, their synthesis, and what is left of a design once it flies."""
