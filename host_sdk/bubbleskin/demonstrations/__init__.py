"""The paper's three demonstrations, on any wristband: the pulse, the topographic mouse, the digital buttons."""
