"""Zones told by direction: a radius in each, and the ellipse fitted to them.

radii     a zone told by direction, and the ellipse fitted to it
quantile  where all but a share of encounters keep out
"""
