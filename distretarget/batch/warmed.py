"""Imported by the process from which workers are forked: they have all compiled before their first clip."""

from distretarget.batch import task as task
from distretarget.retarget import OBJECTIVES
from distretarget.warm import warm

warm(OBJECTIVES[0])
