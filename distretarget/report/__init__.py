"""A diff as a document of numbers and as a page that shows them and plays both motions; and a page over many clips."""

from distretarget.report.document import About, document
from distretarget.report.index import index_page
from distretarget.report.page import page
from distretarget.report.run import run_page

__all__ = ["About", "document", "index_page", "page", "run_page"]
