"""A diff as a document of numbers and as a page that shows them and plays both motions; and a page over many clips."""
