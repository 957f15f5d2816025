"""Built-in solvers, one method per file."""
