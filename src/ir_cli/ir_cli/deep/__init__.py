"""`ir cell check`: what a robot can do at the stations of a cell, and what to write into the file
instead.
"""
