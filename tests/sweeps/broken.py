"""A module of tasks with a mistake, as its author has it while writing."""

raise ZeroDivisionError("of its own")
