"""Is it true: a synthetic square whose people keep a known social zone.

truth        the settings of the plaza and the zone that its people keep: `PlazaSettings`
people       who walks there, and what a sensor records of them: `make_plaza`
scores       how near to the truth: whom a rule for outliers found, how far a zone is off
indifferent  a plaza on which nobody minds anybody: `indifferent_crowd`
"""
