"""What one photograph tells about depth: arrays in, arrays out.

``vanishing`` finds where lines meet, ``cues`` what is sky and what stands in front, ``agreement`` scores a
depth map against the true range.
"""
