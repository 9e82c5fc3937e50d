"""A pipeline over a whole data set: variants, names, journal, workers, labels, manifest."""
