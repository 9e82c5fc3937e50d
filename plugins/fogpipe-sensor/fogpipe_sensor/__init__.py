"""A camera sensor for fogpipe. The stages are in :mod:`fogpipe_sensor.sensor`."""
