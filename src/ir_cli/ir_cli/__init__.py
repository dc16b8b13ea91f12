"""The `ir` command: demonstration, service calls, cells and reports."""
