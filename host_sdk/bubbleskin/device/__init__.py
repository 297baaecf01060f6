"""What a wristband tells of itself and takes from its host, as Python values; a module for each kind."""
