"""What is claimed about a model, how it is found, and how it is proven."""
