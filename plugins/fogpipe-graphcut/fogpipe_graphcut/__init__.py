"""α-expansion by graph cuts for fogpipe. The stage is in :mod:`fogpipe_graphcut.expansion`."""
