"""What the device does when it is asked: a module for each group of requests."""
