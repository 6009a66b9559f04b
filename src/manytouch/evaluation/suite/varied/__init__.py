"""Cases of other shapes on other sheets: what presses, how it is solved, its recording, its drawn sensor.

The cases that press balls into one sheet are in `suite`, bonded pads in `suite.pads`.
"""
