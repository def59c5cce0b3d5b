"""What a diff says, to be read: a document of numbers, and a page that shows it and plays both motions.

And a page over many clips, with links to theirs.
"""

from distretarget.report.document import About, document
from distretarget.report.index import index_page
from distretarget.report.page import page
from distretarget.report.run import run_page

__all__ = ["About", "document", "index_page", "page", "run_page"]
