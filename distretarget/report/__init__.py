"""Reports: diffs as documents of numbers, and HTML pages on clips, scenes and batches."""
