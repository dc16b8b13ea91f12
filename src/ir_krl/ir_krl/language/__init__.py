"""The language: texts of .src and .dat files to routines and data, with places for every
complaint.
"""

from ir_krl.language.parse import Parameter, Routine, SourceFile, SyntaxTree, Word, parse, place_of

__all__ = ["Parameter", "Routine", "SourceFile", "SyntaxTree", "Word", "parse", "place_of"]
