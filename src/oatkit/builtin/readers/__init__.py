"""Built-in readers of scan files, one method per file."""
