"""Built-in forward models, one method per file."""
