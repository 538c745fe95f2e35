"""The inequalities of this room at single frequencies, from the definition: a second writing."""
