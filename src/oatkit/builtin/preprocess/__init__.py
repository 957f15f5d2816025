"""Built-in preprocessors, one method per file."""
