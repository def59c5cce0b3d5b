"""Imported by the process from which workers are forked, so that workers have all code compiled from the start."""

from distretarget.batch import workers as workers
from distretarget.batch.compile_ahead import warm

warm("contact")
