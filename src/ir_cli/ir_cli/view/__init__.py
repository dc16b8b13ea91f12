"""`ir view`: a cell file in a browser, checked and planned again whenever it changes."""
