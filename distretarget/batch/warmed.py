"""Imported by the process from which workers are forked: they have all compiled before their first clip."""

from distretarget.batch import task as task
from distretarget.batch.compile_ahead import warm
from distretarget.retargeting import OBJECTIVES

warm(OBJECTIVES[0])
