"""Reports: self-contained HTML pages with tables and plots.

A stand is the machine that moves a puppet, and a cue a line of a play. An identification estimates
numbers of a puppet from a record of its motion.
"""

from fantoccini.output.reports.identified_page import identified_report
from fantoccini.output.reports.play_page import play_report
from fantoccini.output.reports.stand_page import stand_report

__all__ = ["identified_report", "play_report", "stand_report"]
