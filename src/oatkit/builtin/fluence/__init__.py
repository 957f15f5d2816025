"""Models of light."""
