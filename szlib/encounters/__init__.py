"""Who met whom, alone: windows in which two people share the attentional space.

geometry   the area and the attentional space
areas      an area as it is written, or as people walked: `as_area`, `walked_area`
kinds      companions, same direction, opposite, crossing, standing: on the whole common track
search     the four conditions of the paper: `find_encounters`
streaming  of a raw day only the rows near the square
pipeline   every parameter from the files of a day to its encounters, and how these are stored
days       many days, resumable, on one machine or many: `extract_days`
shifting   the same people, each moved in time alone: `time_shifted`
null       the null model, encounters where nobody minds anybody: `null_encounters`
"""
