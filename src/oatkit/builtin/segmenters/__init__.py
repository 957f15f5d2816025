"""Ways to find the body: a contour in the image, or one that is handed in."""
