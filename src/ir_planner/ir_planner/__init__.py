"""Planning core: movements and programs of an industrial robot among machines, with joules, seconds and
clearance.
"""
