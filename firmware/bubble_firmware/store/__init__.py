"""What survives a power cut: two slots of flash, their records, the settings."""
