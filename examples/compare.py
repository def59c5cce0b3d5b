"""Retarget a clip, print how far the result and the copied rotations are from the source, and write a report.

python examples/compare.py CLIP.bvh TARGET REPORT.html
"""

import sys

from distretarget import load_target, read_bvh, retarget, write_report

result = retarget(read_bvh(sys.argv[1]), load_target(sys.argv[2]))
for name, metrics in result.metrics.items():
    print(name, {key: round(value, 4) for key, value in metrics.items() if value is not None})
write_report(sys.argv[3], result)
