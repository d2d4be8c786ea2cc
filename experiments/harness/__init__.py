"""Framework of the experiments: arguments, tasks, results, statistics and reports."""
