"""Built-in regularizers, one method per file."""
