"""What all experiments share: runs, seeds, results, statistics, reports."""
