"""What may move at all: the board's state, the deadman, what is watched, what has gone wrong."""
