"""Imported by the process from which workers are forked, so that workers have all code compiled from the start."""

from distretarget.batch import task as task
from distretarget.batch.compile_ahead import warm
from distretarget.pipeline.retargeting import OBJECTIVES

warm(OBJECTIVES[0])
