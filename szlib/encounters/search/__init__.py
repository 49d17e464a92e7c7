"""The four conditions of the paper, on whole days at once: `find_encounters`.

occupants  who is in whose attentional space
windows    windows of 3 s that meet a condition throughout
samples    what is measured in a window, and both people's paths in the reference pedestrian's frame
nearby     the rows that encounters in a square can depend on
finding    the four conditions, one after the other
"""

from .finding import find_encounters
from .samples import SAMPLE_COLUMNS, reference_frame

__all__ = ["SAMPLE_COLUMNS", "find_encounters", "reference_frame"]
