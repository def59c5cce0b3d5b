"""Imported by the process from which workers are forked, so that workers have all code compiled from the start."""

from distretarget.batch import workers as workers
from distretarget.pipeline.compile_ahead import warm

warm("contact")
