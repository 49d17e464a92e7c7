"""Respect or emptiness: where people were, against where they would be if nobody minded anybody.

presence      how often people were where, and the map of the pair correlation: `pair_correlation`
boundary      the contour within which they were half as often: `respect_boundary`
significance  is it respect at all: `null_test`
estimate      its way to zones, to go again with other people
"""
