"""Many scans through one pipeline."""
