"""What a wristband tells of itself, as Python values."""
