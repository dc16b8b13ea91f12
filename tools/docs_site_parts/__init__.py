"""Parts of the documentation's site: its lists, links, rendering and reference."""
