"""What came of a run, to read without running anything: one HTML file that needs no network.

front_page  what was run, the funnel, the zone, claims, the four scenarios, parameters
document    the front page and every executed notebook, as one page
"""
