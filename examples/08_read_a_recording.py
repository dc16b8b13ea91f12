"""Read a recording without ROS: what each step took, and the share of every power mode.

`python examples/08_read_a_recording.py out/demo.mcap`, after `make demo`.
"""

import sys

from ir_recorder import analyse, findings, read_recording


def main(path: str = "out/demo.mcap") -> None:
    analysis = analyse(read_recording(path))
    print(f"{analysis.seconds:.1f} s, {analysis.energy / 1000.0:.1f} kJ at the mains")
    for result in analysis.steps:
        print(f"{result.step.label:32} {result.seconds:7.2f} s {result.energy:9.0f} J")
    for share in analysis.modes:
        print(f"{share.name:32} {share.seconds:7.2f} s {share.energy:9.0f} J")
    for check in findings(analysis):
        print(f"{check.verdict}: {check.name}")


if __name__ == "__main__":
    main(*sys.argv[1:])
