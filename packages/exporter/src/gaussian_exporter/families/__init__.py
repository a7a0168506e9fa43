"""One module for each family of models: its arrays, and the graph that it writes."""
