"""Launch file, parameters and views of the cell; the nodes themselves need none of them."""
