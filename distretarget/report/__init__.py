"""What a diff says, to be read: a document of numbers, and a page that shows it and plays both motions."""

from distretarget.report.document import About, document
from distretarget.report.page import page
from distretarget.report.run import run_page

__all__ = ["About", "document", "page", "run_page"]
