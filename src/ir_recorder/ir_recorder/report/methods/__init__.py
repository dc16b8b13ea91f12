"""What the paper's methods did for a program: a sentence and a drawing each, from the logs of a
recording.
"""

from ir_recorder.report.methods.section import methods_section

__all__ = ["methods_section"]
