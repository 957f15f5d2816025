"""The pipeline beside the picture: its steps as cards, what runs them, and what a run tells."""
