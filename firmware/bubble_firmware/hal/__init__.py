"""What a board's hardware does: the interface, the Raspberry Pi Pico, and a plant at the other end of a pipe."""
