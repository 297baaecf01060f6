"""The same task on many simulated wristbands: every combination of what varies, on every core there is, kept as it comes."""
