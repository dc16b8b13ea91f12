"""`ir view`: a cell in a browser, from its file: looked at, moved about, checked and planned
again.
"""
