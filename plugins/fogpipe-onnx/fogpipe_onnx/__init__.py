"""Learned monocular depth for fogpipe. The stages are in :mod:`fogpipe_onnx.depth`."""
