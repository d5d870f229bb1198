"""Reports: self-contained HTML pages with tables and plots."""

from fantoccini.output.reports.identified_page import identified_report
from fantoccini.output.reports.play_page import play_report
from fantoccini.output.reports.stand_page import stand_report

__all__ = ["identified_report", "play_report", "stand_report"]
