"""Retarget many clips to one or several targets, into folders of results with a database each."""
