"""Reports: one HTML file that needs no network, with a 3D scene and charts, made of results.

`document` has the parts of a report as plain data, which a page's JavaScript (page/) draws; `page` puts the file
together. `scene`, `estimates` and `charts` make parts from tracks and estimates, with or without a truth. What is
flown or drawn many times makes its own in `baryscope.study`.
"""

from baryscope.report.document import Report
from baryscope.report.estimates import prediction_chart
from baryscope.report.joints import report_of_joint
from baryscope.report.own_tracks import report_of_estimate
from baryscope.report.page import html_of, write_report

__all__ = ["Report", "html_of", "prediction_chart", "report_of_estimate", "report_of_joint", "write_report"]
