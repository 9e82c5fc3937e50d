"""Atmospheric point spread functions, and blur with them from pixel to pixel."""
