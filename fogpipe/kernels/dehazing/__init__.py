"""Haze taken off an image: what bounds the transmission, how it is estimated, and the inverse of the haze equation."""
