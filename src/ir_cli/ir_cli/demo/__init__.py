"""`ir demo`: plan, drive, record and explain a cell, with real nodes in processes of their own."""
