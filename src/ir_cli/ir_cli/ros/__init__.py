"""Commands that need ROS: nodes of a cell, the graph, recordings planned again."""
