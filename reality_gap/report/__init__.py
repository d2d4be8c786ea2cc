"""Report: the files of a diagnosis, which are verdict.json, the extended model and report.html."""
