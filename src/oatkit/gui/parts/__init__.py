"""What several widgets are built of: forms made from declared parameters, fields, choosers, plots, sliders."""
