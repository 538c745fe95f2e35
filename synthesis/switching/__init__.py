"""Linear control that switches between designs: its dwell times, and the controller that flies."""
