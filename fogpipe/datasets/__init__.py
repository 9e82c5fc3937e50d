"""Data sets: readers that tell which images, depth, cameras and labels a folder holds. No pixel is read here."""
