"""What a proof of motion can end in."""

FREE = 0  # proved: every distance stays above its threshold
COLLIDES = 1  # at some time a distance isn't above its threshold
UNDECIDED = 2  # neither could be shown: count it as unsafe
