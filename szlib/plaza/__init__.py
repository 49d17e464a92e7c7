"""Is it true: a synthetic square whose people keep a known social zone.

settings    the settings of the plaza, and the zone that its people keep: `PlazaSettings`
generation  how its people walk, and what a sensor records of them: `make_plaza`
accuracy    how precise a rule for outliers is, and how far a zone is from the true one
"""
