"""Which bubble goes first, what to send, and why."""
