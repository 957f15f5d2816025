"""The regularization weight, chosen on the L-curve."""
