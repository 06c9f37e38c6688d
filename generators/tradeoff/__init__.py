"""What each setting costs in time and in error: measured by `fgf tradeoff`, and read by who chooses settings."""
